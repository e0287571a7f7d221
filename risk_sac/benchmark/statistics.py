"""Statistics of times to detection, which the budget cuts off (right-censored). Pure.

Sources: Hazimeh et al. 2020, "Magma: a ground-truth fuzzing benchmark" (survival analysis); ARCH-COMP, category
falsification (falsification rate); Klees et al. 2018, "Evaluating fuzz testing" (A12, tests over trials).
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median

from risk_sac.benchmark.detection import Detection
from risk_sac.config import RunMethod
from risk_sac.metrics.intervals import RESAMPLING_SEED, bootstrap_interval
from risk_sac.report.paired import vargha_delaney
from risk_sac.types import Floats

REFERENCE: RunMethod = "random"


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """A method over all defects and seeds."""

    method: RunMethod
    runs: int
    detected: int
    mean_steps: float | None  # over the runs that detected
    median_steps: float | None
    restricted_mean: float  # of the time to detection, up to the budget
    low: float  # bootstrap 95 % interval over runs
    high: float
    a12: float | None  # chance that random search takes longer; None of random search, and without it
    p: float | None  # log-rank test against random search
    always: int  # defects that every run detected
    once: int  # defects that a run detected
    never: int

    @property
    def rate(self) -> float:
        """The falsification rate."""
        return self.detected / self.runs


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


def summaries(detections: Sequence[Detection]) -> list[Summary]:
    """Returns a summary for each method, the quickest first."""
    by_method: dict[RunMethod, list[Detection]] = defaultdict(list)
    for each in detections:
        by_method[each.method].append(each)
    found = [_summary(method, by_method) for method in by_method]
    return sorted(found, key=lambda each: each.restricted_mean)


def _summary(method: RunMethod, by_method: Mapping[RunMethod, Sequence[Detection]]) -> Summary:
    runs, reference = by_method[method], by_method.get(REFERENCE)
    compared = reference if method != REFERENCE else None
    detected = [float(each.detected) for each in runs if each.detected is not None]
    restricted = times(runs)
    low, high = bootstrap_interval(restricted, RESAMPLING_SEED)
    outcomes: dict[tuple[str, ...], list[bool]] = defaultdict(list)
    for each in runs:
        outcomes[each.defects].append(each.detected is not None)
    return Summary(
        method=method,
        runs=len(runs),
        detected=len(detected),
        mean_steps=mean(detected) if detected else None,
        median_steps=median(detected) if detected else None,
        restricted_mean=mean(restricted),
        low=low,
        high=high,
        a12=vargha_delaney(times(compared), restricted) if compared else None,
        p=log_rank(runs, compared) if compared else None,
        always=sum(map(all, outcomes.values())),
        once=sum(map(any, outcomes.values())),
        never=sum(not any(each) for each in outcomes.values()),
    )


def _censored(detections: Sequence[Detection]) -> object:
    from scipy.stats import CensoredData

    return CensoredData.right_censored(times(detections), [each.detected is None for each in detections])
