"""Tells failures of a scenario as written from those of searches and deviations."""

from collections.abc import Iterable, Sequence
from enum import StrEnum

from risk_sac.config import FamilyName, RunMethod, method_of
from risk_sac.records import EpisodeRecord, Outcome, Record
from risk_sac.report.runs import FinishedRun


class PlayedAs(StrEnum):
    """What a run changes of a scenario; each begins where the one before ends."""

    AS_WRITTEN = "the grid as written"
    SEARCHED = "its parameters searched"
    DEVIATING = "others deviate"


class FailureOrigin(Record):
    """Failures of one scenario that begin with one way to play it. Those count that may be headline failures."""

    family: FamilyName
    played: PlayedAs
    methods: tuple[RunMethod, ...]
    episodes: int
    """Rejected scenes included."""
    rejected: int
    failures: int
    """Episodes with such a failure."""
    kinds: int
    new_kinds: int
    """Of these kinds, those that the ways before did not find."""
    least_speed_mps: float | None = None
    """Least deviation from the story that such an episode took: the largest of its actors' speeds. Null without
    deviations."""
    least_across_m: float | None = None
    """The same of their places across the road."""
    least_trigger_s: float | None = None
    """The same of shifts of their triggers."""


def played_as(method: RunMethod) -> PlayedAs | None:
    """Returns what a method changes of a scenario; None of a control without a story."""
    row = method_of(method)
    if row.story:
        return PlayedAs.AS_WRITTEN if row.scenes == "grid" else PlayedAs.SEARCHED
    return None if row.agent == "none" else PlayedAs.DEVIATING


def failure_origins(runs: Sequence[FinishedRun]) -> tuple[FailureOrigin, ...]:
    """The failures of scenarios that some method plays as they are written; of others nothing."""
    families = dict.fromkeys(run.spec.family for run in runs if method_of(run.spec.method).story)
    return tuple(row for family in families for row in _of_family([run for run in runs if run.spec.family == family]))


def _of_family(runs: Sequence[FinishedRun]) -> Iterable[FailureOrigin]:
    known = set[str]()
    for played in PlayedAs:
        own = [run for run in runs if played_as(run.spec.method) is played]
        if not own:
            continue
        records = [record for run in own for record in run.phase("search")]
        failing = {id(record): kinds for record in records if (kinds := _kinds(record))}
        kinds = set().union(*failing.values())
        deviating = [record for record in records if id(record) in failing and record.deviations]
        speeds = [max(each.speed_mps for each in record.deviations.values()) for record in deviating]
        across = [max(each.across_m for each in record.deviations.values()) for record in deviating]
        triggers = [max(each.trigger_s for each in record.deviations.values()) for record in deviating]
        yield FailureOrigin(
            family=own[0].spec.family,
            played=played,
            methods=tuple(dict.fromkeys(run.spec.method for run in own)),
            episodes=len(records),
            rejected=sum(record.outcome is Outcome.REJECTED for record in records),
            failures=len(failing),
            kinds=len(kinds),
            new_kinds=len(kinds - known),
            least_speed_mps=min(speeds, default=None),
            least_across_m=min(across, default=None),
            least_trigger_s=min(triggers, default=None),
        )
        known |= kinds


def _kinds(record: EpisodeRecord) -> set[str]:
    """Kinds of an episode's failures that may be headline failures."""
    return {violation.kind for violation in record.valid_violations if violation.headline_candidate}
