"""Failure rates of a run of the method `rate`, from its records.

Also the points that such a run plays first.

Source of the interval: the delta method on a ratio of weighted sums, on the logarithm of the rate.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from risk_sac.config import FamilyName, RateStart, RunSpec
from risk_sac.config.scenario import ScenarioParameter
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.metrics import clopper_pearson
from risk_sac.rates.proposal import DECLARED, Draws, Stages, draws_of
from risk_sac.records import REPEATS, EpisodeRecord, Outcome, wire
from risk_sac.records.rates import ANY, DeclaredParameter, HourlyRate, RateEstimate, Rates
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import RATES, RESULTS, RunResults, read_results
from risk_sac.scenario.declared import SceneLaw
from risk_sac.world.types import Floats, Scene

Flags = np.typing.NDArray[np.bool_]
LEAST_EFFECTIVE = 15.0  # failures of equal weight that would tell as much; choice
MOST_OF_ONE = 0.25  # share of the estimate that one draw may have; choice
MOST_DECLARED = 0.5  # share of the estimate that draws of the declared distribution may have; choice
MOST_ERRORS = 4.0  # standard errors by which the mean weight may differ from 1; choice
CONFIDENCE = 0.95
UNSEEN = 1.15  # choice: part of the error comes from regions that no draw reached; repeated experiments cover with it


def estimated(ratios: Floats, trust: Floats, failed: Flags, played: Flags) -> RateEstimate:
    """Estimates the rate of failures among played scenes.

    rate = Σ w f / (n - Σ w u),  w = a p/q,  se² = Σ r² / (n - Σ w u)²,  log rate ± 1.15 t se / rate

    r = w f + rate w u, less its mean. The expected sum of all weights is n, so the sum itself, whose chance deviation
    would add to the error, is not used. t has the effective number of failures, (Σ w f)² / Σ (w f)², less one as its
    degrees of freedom.

    Args:
      ratios: p/q, `n`, density of the declared distribution over that of the draw's own proposal.
      trust: a, `n`, of mean 1; see `Stages.trust`.
      failed: f, `n`.
      played: `n`; of a scene that was not (u), nothing is said.
    """
    weights, failed = ratios * trust, failed & played
    hits, refused, count = weights * failed, weights * ~played, int(failed.sum())
    total = len(weights) - float(refused.sum())
    bound = min(1.0, clopper_pearson(count, len(weights))[1] / DECLARED * len(weights) / max(total, 1e-300))
    if not count or total <= 0.0:
        why = "no draw failed" if not count else "no scene could be played"
        return _unestimated(why, bound, count)
    rate = float(hits.sum()) / total
    parts = hits + rate * refused
    error = math.sqrt(float(((parts - trust * parts.mean()) ** 2).sum())) / total
    effective = float(hits.sum() ** 2 / (hits**2).sum())
    largest = float(hits.max() / hits.sum())
    declared = float((hits * DECLARED * ratios).sum() / hits.sum())
    checks = {"effective_failures": effective, "largest_share": largest, "declared_share": min(declared, 1.0)}
    why = _objection(weights, effective, largest, declared)
    if why:
        return _unestimated(why, bound, count).model_copy(update=checks)
    half = UNSEEN * _student(effective - 1.0) * error / rate
    return RateEstimate(
        failures=count,
        rate=min(rate, 1.0),
        low=min(rate * math.exp(-half), 1.0),
        high=min(rate * math.exp(half), 1.0),
        why="",
        at_most=bound,
        **checks,
    )


def with_exposure(estimates: Mapping[str, RateEstimate], scenes_per_hour: float | None) -> dict[str, RateEstimate]:
    """Adds rates per hour, given scenes per hour; None adds none."""
    if scenes_per_hour is None:
        return dict(estimates)
    return {name: _hourly(estimate, scenes_per_hour) for name, estimate in estimates.items()}


def _hourly(estimate: RateEstimate, scenes: float) -> RateEstimate:
    if estimate.rate is None or estimate.low is None or estimate.high is None:
        return estimate
    hourly = HourlyRate(rate=estimate.rate * scenes, low=estimate.low * scenes, high=estimate.high * scenes)
    return estimate.model_copy(update={"per_hour": hourly})


def _objection(weights: Floats, effective: float, largest: float, declared: float) -> str:
    error = float(weights.std()) / math.sqrt(len(weights))
    if abs(float(weights.mean()) - 1.0) > MOST_ERRORS * error + 1e-9:
        return f"the mean weight is {weights.mean():.2f}, not 1"
    if effective < LEAST_EFFECTIVE:
        return f"the failures tell as much as {effective:.1f} of equal weight; {LEAST_EFFECTIVE:g} are needed"
    if largest > MOST_OF_ONE:
        return f"one draw has {largest:.0%} of the estimate; {MOST_OF_ONE:.0%} are allowed"
    if declared > MOST_DECLARED:
        return f"draws of the declared distribution have {declared:.0%} of the estimate, so failures may lie elsewhere"
    return ""


def _unestimated(why: str, bound: float, count: int) -> RateEstimate:
    return RateEstimate(
        failures=count,
        rate=None,
        low=None,
        high=None,
        why=why,
        at_most=bound,
        effective_failures=0.0,
        largest_share=0.0,
        declared_share=0.0,
    )


def _student(freedom: float) -> float:
    from scipy.special import stdtrit  # here, because few ask for it, and every process of a server loads this

    return float(stdtrit(max(freedom, 1.0), 1.0 - (1.0 - CONFIDENCE) / 2.0))


METHOD = "rate"
UNKNOWN = frozenset({Outcome.REJECTED, Outcome.INVALID})
MOST_PER_HOUR = 1e9


def stages_of(declared: SceneLaw, draws: int, seed: int, start: RateStart | None = None) -> Stages:
    """Returns a run's stages; axes without telling values are drawn as declared."""
    earlier = None if start is None else declared.normals(start.scenes)
    return Stages(int(declared.telling.sum()), draws, seed, earlier)


def rates_of(spec: RunSpec, records: Sequence[EpisodeRecord], scenes_per_hour: float | None = None) -> Rates:
    """Estimates a run's rates, finished or not, from its records alone.

    Args:
      spec: of a run of the method `rate`.
      records: its episodes, all of them from the first one on.
      scenes_per_hour: exposure, with which a rate in a scene becomes one in an hour.

    Raises:
      ConfigError: the run is of another method, has no episodes, or the exposure is negative.
    """
    if spec.method != METHOD:
        raise ConfigError("method", repr(spec.method), f"{METHOD!r}, whose draws can be weighted")
    check_exposure(scenes_per_hour)
    if not records:
        raise ConfigError("", f"{spec.id} without an episode", "one episode or more")
    problem = Problem.from_spec(spec)
    declared = problem.declared
    stages = stages_of(declared, spec.budget.episodes, spec.stream, spec.rate)
    draws = _draws(problem, declared, records)
    ratios, trust = stages.ratios(draws), stages.trust(len(draws))
    played = np.array([record.outcome not in UNKNOWN for record in records])
    events = {name: np.array([name in record.failed for record in records], dtype=bool) for name in rated(problem)}
    events[ANY] = np.array([record.outcome is Outcome.FAILURE for record in records], dtype=bool)
    rates = {name: estimated(ratios, trust, event, played) for name, event in events.items()}
    correlation = problem.family.rank_correlation
    return Rates(
        run_id=spec.id,
        draws=len(records),
        asked=spec.budget.episodes,
        played=int(played.sum()),
        scenes_per_hour=scenes_per_hour,
        rates=with_exposure(rates, scenes_per_hour),
        distributions={name: _said(problem.family.parameters.get(name)) for name in problem.space.names},
        correlated=() if correlation is None else correlation.parameters,
    )


def write_rates(folder: Path, spec: RunSpec, records: Sequence[EpisodeRecord]) -> None:
    """Writes an ended run's rates to its folder; see `rates_of`."""
    replace_file(folder / RATES, wire(rates_of(spec, records)))


def rated(problem: Problem) -> tuple[str, ...]:
    """Lists the events with a rate: any failure, and each counting requirement."""
    return ANY, *(requirement.name for requirement in problem.requirements if requirement.counts == "failure")


def check_exposure(scenes_per_hour: float | None) -> None:
    """Refuses an exposure that is negative or no number.

    Raises:
      ConfigError: naming it.
    """
    if scenes_per_hour is not None and not 0.0 <= scenes_per_hour <= MOST_PER_HOUR:
        raise ConfigError("exposure", f"{scenes_per_hour:g}", f"scenes in an hour, 0 to {MOST_PER_HOUR:g}")


def _draws(problem: Problem, declared: SceneLaw, records: Sequence[EpisodeRecord]) -> Draws:
    space = problem.space
    units = [space.to_unit(Scene(space.family, record.scene)) for record in records]
    margins = [
        {name: result.robustness for name, result in record.requirements.items() if result.counts == "failure"}
        for record in records
    ]
    points = [declared.normal(unit)[declared.telling] for unit in units]
    return draws_of(points, margins, [_failed_as_played(record) for record in records])


def _failed_as_played(record: EpisodeRecord) -> bool:
    """Whether the sampler saw a failure, before any replay that went differently."""
    violations = (record.collision, *record.violations)
    return any(not set(violation.broken) - {REPEATS} for violation in violations if violation is not None)


def _said(parameter: ScenarioParameter | None) -> DeclaredParameter:
    if parameter is None or parameter.distribution is None:
        return DeclaredParameter(kind="uniform", source="")
    return DeclaredParameter(kind=parameter.distribution.kind, source=parameter.source)


FIELD = "from"
MOST = 300  # scenes of a start, from the first failure to the last


def start_in(folder: Path, family: FamilyName) -> RateStart:
    """Returns the scenes in which earlier runs of a scenario failed.

    Args:
      folder: of a run, or of a campaign.
      family: the scenario.

    Raises:
      ConfigError: there is no run, or none of this scenario, by these definitions, with a failure.
    """
    from risk_sac.verdicts.judge import DEFINITIONS  # here, because it loads what judges an episode

    files = (folder / RESULTS, *sorted(folder.glob(f"runs/*/{RESULTS}")), *sorted(folder.glob(f"*/{RESULTS}")))
    runs = [read_results(file) for file in files if file.is_file()]
    if not runs:
        raise ConfigError(FIELD, f"{folder}, without {RESULTS}", "the folder of an earlier run or campaign")
    alike = [run for run in runs if run.spec.family == family]
    if not alike:
        others = ", ".join(sorted({run.spec.family for run in runs}))
        raise ConfigError(FIELD, f"{folder}, whose runs are of {others}", f"a run of {family}")
    judged = [run for run in alike if _definitions(run) == str(DEFINITIONS)]
    if not judged:
        versions = ", ".join(sorted({_definitions(run) for run in alike}))
        got = f"{folder}, judged by definitions {versions}"
        raise ConfigError(FIELD, got, f"definitions {DEFINITIONS}", "run it again, and name the new folder")
    scenes = [failure.episode.scene for run in judged for failure in run.failures if failure.episode.valid_violations]
    if not scenes:
        got = f"{folder}, without a failure of {family}"
        raise ConfigError(FIELD, got, "a run that has found some", "leave it out: the estimate needs none")
    return RateStart(scenes=tuple(scenes[:: -(-len(scenes) // MOST)]))


def _definitions(run: RunResults) -> str:
    return (run.versions or {}).get("definitions", "unknown")
