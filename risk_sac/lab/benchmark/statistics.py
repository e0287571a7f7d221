"""Statistics of right-censored times to detection. Pure.

Sources: Hazimeh et al. 2020, "Magma: a ground-truth fuzzing benchmark" (survival analysis); ARCH-COMP, category
falsification (falsification rate); Klees et al. 2018, "Evaluating fuzz testing" (A12, tests over trials);
Demšar 2006, "Statistical comparisons of classifiers over multiple data sets" (Friedman test, critical differences).
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median

import numpy as np

from risk_sac.config import RunMethod
from risk_sac.lab.benchmark.runs import Detection
from risk_sac.metrics.metric import RESAMPLING_SEED, bootstrap_interval
from risk_sac.report.statistics import vargha_delaney
from risk_sac.world.types import Floats

REFERENCE: RunMethod = "random"
LEAST_METHODS, LEAST_DEFECTS = 3, 2  # of a Friedman test
By = Mapping[tuple[str, ...], Sequence[Detection]]
"""Runs of a method by defect."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodSummary:
    """A method over all defects and seeds."""

    method: RunMethod
    runs: int
    detected: int
    mean_steps: float | None  # over the runs that detected
    median_steps: float | None
    restricted_mean: float  # of the time to detection, up to the budget
    low: float  # bootstrap 95 % interval over runs
    high: float
    a12: float | None  # chance that random search takes longer, mean over defects; None of random search
    p: float | None  # log-rank test against random search
    always: int  # defects that every run detected
    once: int  # defects that a run detected
    never: int


def balanced(detections: Sequence[Detection]) -> list[Detection]:
    """Returns the runs of defects and seeds that every method has played."""
    methods = {each.method for each in detections}
    played: dict[tuple[object, ...], set[RunMethod]] = defaultdict(set)
    for each in detections:
        played[each.defects, each.family, each.seed].add(each.method)
    return [each for each in detections if played[each.defects, each.family, each.seed] == methods]


def times(detections: Sequence[Detection]) -> list[float]:
    """Times to detection; the budget where there was none."""
    return [float(each.budget_steps if each.detected is None else each.detected) for each in detections]


def survival(detections: Sequence[Detection]) -> tuple[Floats, Floats]:
    """Kaplan-Meier estimate of the share of runs that have not detected their defect yet.

    Returns:
      Environment steps at which it falls, and the share from there on.
    """
    from scipy.stats import ecdf

    left = ecdf(_censored(detections)).sf
    return left.quantiles, left.probabilities


def log_rank(first: Sequence[Detection], second: Sequence[Detection]) -> float:
    """P value of the log-rank test of two times to detection; 1 without any."""
    from scipy.stats import logrank

    if all(each.detected is None for each in (*first, *second)):
        return 1.0
    return float(logrank(_censored(first), _censored(second)).pvalue)


def summaries(detections: Sequence[Detection]) -> list[MethodSummary]:
    """Returns a summary for each method, the quickest first."""
    by_method = _by_method(detections)
    found = [_summary(method, runs, by_method.get(REFERENCE)) for method, runs in by_method.items()]
    return sorted(found, key=lambda each: each.restricted_mean)


def restricted_means(detections: Sequence[Detection]) -> tuple[list[RunMethod], Floats]:
    """Returns the methods, and the restricted mean time to detection, `defects x methods`, of balanced runs."""
    by_method = _by_method(detections)
    columns = [[mean(times(runs)) for runs in defects.values()] for defects in by_method.values()]
    return list(by_method), np.array(columns, dtype=np.float64).T.reshape(-1, len(columns))


def friedman(means: Floats) -> float | None:
    """Returns the P value of the Friedman test over defects.

    It tests that all methods rank alike. None if there are too few methods or defects.

    Args:
      means: `defects x methods`.
    """
    from scipy.stats import friedmanchisquare

    if len(means) < LEAST_DEFECTS or means.shape[1] < LEAST_METHODS:
        return None
    if (means == means[:, :1]).all():  # the statistic would be 0 / 0
        return 1.0
    return float(friedmanchisquare(*means.T).pvalue)


def _by_method(detections: Sequence[Detection]) -> dict[RunMethod, By]:
    found: dict[RunMethod, dict[tuple[str, ...], list[Detection]]] = defaultdict(lambda: defaultdict(list))
    for each in sorted(detections, key=lambda each: (each.defects, each.seed)):
        found[each.method][each.defects].append(each)
    return {method: found[method] for method in dict.fromkeys(each.method for each in detections)}


def _summary(method: RunMethod, by_defect: By, reference: By | None) -> MethodSummary:
    runs = [each for defect in by_defect.values() for each in defect]
    detected = [float(each.detected) for each in runs if each.detected is not None]
    restricted = times(runs)
    low, high = bootstrap_interval(restricted, RESAMPLING_SEED)
    outcomes = [[each.detected is not None for each in defect] for defect in by_defect.values()]
    compared = reference if method != REFERENCE else None
    a12 = p = None
    if compared:
        common = by_defect.keys() & compared.keys()
        a12 = mean(vargha_delaney(times(compared[each]), times(by_defect[each])) for each in sorted(common))
        p = log_rank(runs, [each for defect in compared.values() for each in defect])
    return MethodSummary(
        method=method,
        runs=len(runs),
        detected=len(detected),
        mean_steps=mean(detected) if detected else None,
        median_steps=median(detected) if detected else None,
        restricted_mean=mean(restricted),
        low=low,
        high=high,
        a12=a12,
        p=p,
        always=sum(map(all, outcomes)),
        once=sum(map(any, outcomes)),
        never=sum(not any(each) for each in outcomes),
    )


def _censored(detections: Sequence[Detection]) -> object:
    from scipy.stats import CensoredData

    return CensoredData.right_censored(times(detections), [each.detected is None for each in detections])
