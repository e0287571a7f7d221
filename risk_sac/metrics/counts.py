"""Counts of a run, and their sums over runs."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

from risk_sac.records import RunMetrics


@dataclass(kw_only=True)
class Counts:
    """The counts of a run, as `RunMetrics` has them; several runs have their sums."""

    episodes: int = 0
    rejected: int = 0
    raw_collisions: int = 0
    failures: int = 0
    distinct_failures: int = 0
    preventable: int = 0
    avoidable: int = 0
    distinct_preventable: int = 0
    artefacts: int = 0
    unresponsive: int = 0
    invalid: int = 0
    environment_steps: int = 0

    @property
    def driven(self) -> int:
        """Episodes that rates are taken over: all, but for those in which the ego failed to drive."""
        return self.episodes - self.invalid


COUNTS = tuple(each.name for each in fields(Counts))


def pooled_counts(metrics: Sequence[RunMetrics]) -> Counts:
    """Each count summed over the runs; what two runs found alike counts twice."""
    return Counts(**{name: sum(getattr(each, name) for each in metrics) for name in COUNTS})
