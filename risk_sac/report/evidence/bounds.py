"""How often the ego fails where nobody has searched: bounds from a campaign's i.i.d. phase, and from nothing else."""

from collections.abc import Sequence

from risk_sac.config import FamilyName, IidName
from risk_sac.errors import ConfigError
from risk_sac.metrics import clopper_pearson
from risk_sac.records import RECORDED, EpisodeRecord, Outcome, Record
from risk_sac.report.runs import FinishedRun

CRASHED = "sim_crash"  # the reason of an episode that was left out because the simulator died in it
NOT_PLAYED = (Outcome.REJECTED, Outcome.INVALID)


class Bound(Record):
    """How often something happened, and how often it may happen at most and at least, each with 95 % confidence."""

    count: int
    low: float
    """Clopper-Pearson, one-sided."""
    high: float
    """Clopper-Pearson, one-sided; an episode without an end counts as one in which it happened."""


class Drawn(Record):
    """What came of the scenes of one family and one kind of traffic."""

    family: FamilyName
    method: IidName
    seed: int
    scenes: int
    """That were drawn."""
    refused: int
    """By C_hard, before the first step: of these scenes nothing is said."""
    unended: int
    """In which the simulator died, or the ego failed to drive: what would have happened, nobody knows."""
    played: int
    """All others."""
    contacts: Bound
    failures: Bound
    """Valid ones."""
    preventable: Bound
    """Valid ones that the careful driver would have prevented."""


def drawn(run: FinishedRun) -> Drawn:
    """The bounds of one run of an i.i.d. phase.

    Given how many scenes were refused, the others are independent draws from those that are not, so that the binomial
    distribution holds exactly.

    Raises:
      ConfigError: an episode of the run belongs to another phase.
    """
    if other := {record.phase for record in run.records} - {RECORDED["iid"]}:
        raise ConfigError(f"{run.spec.id} has episodes of the phase {min(other)!r}; wanted those of its own alone")
    played = [record for record in run.records if record.outcome not in NOT_PLAYED]
    unended = sum(record.outcome is Outcome.INVALID or record.reason == CRASHED for record in run.records)
    return Drawn.model_validate(
        {
            **{name: getattr(run.spec, name) for name in ("family", "method", "seed")},
            "scenes": len(run.records),
            "refused": len(run.records) - len(played) - unended,
            "unended": unended,
            "played": len(played),
            "contacts": _bound([record.collision is not None for record in played], unended),
            "failures": _bound([record.outcome is Outcome.FAILURE for record in played], unended),
            "preventable": _bound([_preventable(record) for record in played], unended),
        }
    )


def _bound(happened: Sequence[bool], unended: int) -> Bound:
    count, trials = sum(happened), len(happened) + unended
    low, _ = clopper_pearson(count, trials)
    _, high = clopper_pearson(count + unended, trials)
    return Bound(count=count, low=low, high=high)


def _preventable(record: EpisodeRecord) -> bool:
    return record.collision is not None and record.collision.preventable
