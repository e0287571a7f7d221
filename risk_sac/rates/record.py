"""Failure rates of a run of the method `rate`, from its records alone."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from risk_sac.config import RateStart, RunSpec
from risk_sac.config.scenario import ScenarioParameter
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.rates.estimate import estimated, with_exposure
from risk_sac.rates.stages import Draws, Stages, draws_of
from risk_sac.records import REPEATS, EpisodeRecord, Outcome, wire
from risk_sac.records.rates import ANY, DeclaredParameter, Rates
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import RATES
from risk_sac.scenario.declared import SceneLaw
from risk_sac.world.types import Scene

METHOD = "rate"
UNKNOWN = frozenset({Outcome.REJECTED, Outcome.INVALID})
MOST_PER_HOUR = 1e9


def stages_of(declared: SceneLaw, draws: int, seed: int, start: RateStart | None = None) -> Stages:
    """Returns the stages of a run; axes that do not tell are drawn as declared."""
    earlier = None if start is None else declared.normals(start.scenes)
    return Stages(int(declared.telling.sum()), draws, seed, earlier)


def rates_of(spec: RunSpec, records: Sequence[EpisodeRecord], scenes_per_hour: float | None = None) -> Rates:
    """Estimates the rates of a run, finished or not; a pure function of its records.

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
    """Writes the rates of a run that has ended to its folder; see `rates_of`."""
    replace_file(folder / RATES, wire(rates_of(spec, records)))


def rated(problem: Problem) -> tuple[str, ...]:
    """Lists the events with a rate: any failure, and each requirement that counts."""
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
    """Whether the sampler saw a failure; a replay that went another way came later."""
    violations = (record.collision, *record.violations)
    return any(not set(violation.broken) - {REPEATS} for violation in violations if violation is not None)


def _said(parameter: ScenarioParameter | None) -> DeclaredParameter:
    if parameter is None or parameter.distribution is None:
        return DeclaredParameter(kind="uniform", source="")
    return DeclaredParameter(kind=parameter.distribution.kind, source=parameter.source)
