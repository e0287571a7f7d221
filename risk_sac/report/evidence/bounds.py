"""How often the ego fails where nobody has searched: bounds from a campaign's i.i.d. phase, and from nothing else."""

from collections.abc import Sequence

from risk_sac.config import FamilyName, IidName
from risk_sac.errors import ConfigError
from risk_sac.metrics import clopper_pearson
from risk_sac.records import RECORDED, EpisodeRecord, Outcome, Record
from risk_sac.report.runs import FinishedRun

CRASHED = "sim_crash"  # the reason of an episode that was left out because the simulator died in it


class Bound(Record):
    """How often something happened, and how often it may happen at most and at least, each with 95 % confidence."""

    count: int
    low: float
    """Clopper-Pearson, one-sided."""
    high: float
    """Clopper-Pearson, one-sided; an episode in which the simulator crashed counts as one in which it happened."""


class Drawn(Record):
    """What came of the scenes of one family and one kind of traffic."""

    family: FamilyName
    method: IidName
    seed: int
    scenes: int
    """That were drawn."""
    refused: int
    """By C_hard, before the first step: of these scenes nothing is said."""
    crashed: int
    """In which the simulator died."""
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
    refused = [record for record in run.records if record.outcome is Outcome.REJECTED]
    crashed = sum(record.reason == CRASHED for record in refused)
    played = [record for record in run.records if record.outcome is not Outcome.REJECTED]
    return Drawn.model_validate(
        {
            **{name: getattr(run.spec, name) for name in ("family", "method", "seed")},
            "scenes": len(run.records),
            "refused": len(refused) - crashed,
            "crashed": crashed,
            "played": len(played),
            "contacts": _bound([record.collision is not None for record in played], crashed),
            "failures": _bound([record.outcome is Outcome.FAILURE for record in played], crashed),
            "preventable": _bound([_preventable(record) for record in played], crashed),
        }
    )


def _bound(happened: Sequence[bool], crashed: int) -> Bound:
    count, trials = sum(happened), len(happened) + crashed
    low, _ = clopper_pearson(count, trials)
    _, high = clopper_pearson(count + crashed, trials)
    return Bound(count=count, low=low, high=high)


def _preventable(record: EpisodeRecord) -> bool:
    return record.collision is not None and record.collision.preventable
