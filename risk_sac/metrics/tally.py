"""Counts a run's episodes: all that the formulas of its metrics take."""

import math
from collections import Counter, deque
from typing import Annotated

from pydantic import ConfigDict, Field, PrivateAttr

from risk_sac.errors import NotFinite
from risk_sac.metrics.features import Spread, outcome_features
from risk_sac.records import Counts, EpisodeRecord, Outcome
from risk_sac.types import STEP_S
from risk_sac.verdicts.distinct import DistinctFailures, FailureKind, kind_of

STEPS_PER_S = round(1 / STEP_S)
WINDOW = 100  # episodes of the sliding ECR and PCR


def preventable(record: EpisodeRecord) -> bool:
    """Whether the episode ended in a valid collision that the careful driver would have prevented.

    A collision that was never judged counts as not preventable.
    """
    return record.outcome is Outcome.FAILURE and record.collision is not None and record.collision.preventable


class Tally(Counts):
    """The counts and sums of a run, at a cost per episode that grows only with the number of failures."""

    model_config = ConfigDict(frozen=False)

    horizon_steps: Annotated[int, Field(ge=1)]
    """T."""
    steps_to_failure: int = 0
    """Summed over episodes; T for one without a valid collision."""
    cost: float = 0.0
    """Realism cost C_soft, summed over executed steps."""
    distance: float = 0.0
    """Between two failures' outcome features, summed over all pairs."""
    newest_episodes: int = 0
    """`WINDOW`, or all where there are fewer."""
    newest_failures: int = 0
    """Among them."""
    newest_preventable: int = 0
    signatures: Counter[str] = Field(default_factory=Counter)
    """Signature → valid failures."""
    kinds: set[FailureKind] = Field(default_factory=set)
    """Of the valid failures."""
    conflicts_by_second: list[int] = Field(default_factory=list)
    """Valid failures by the second in which they began."""
    contacts_by_second: list[int] = Field(default_factory=list)
    """The same by the second of the contact."""
    _newest: deque[tuple[bool, bool]] = PrivateAttr(default_factory=lambda: deque(maxlen=WINDOW))
    _spread: Spread = PrivateAttr(default_factory=Spread)
    _distinct: DistinctFailures = PrivateAttr(default_factory=DistinctFailures)
    _distinct_preventable: DistinctFailures = PrivateAttr(default_factory=DistinctFailures)

    def model_post_init(self, context: object, /) -> None:
        """Make a bin for every second that is begun."""
        super().model_post_init(context)
        seconds = math.ceil(self.horizon_steps / STEPS_PER_S)
        self.conflicts_by_second, self.contacts_by_second = [0] * seconds, [0] * seconds

    def add(self, record: EpisodeRecord) -> None:
        """Count one more episode.

        Raises:
            NotFinite: its mean cost, or when its conflict or contact was, is not finite, or an outcome feature is NaN.
            ValueError: it is a failure without a collision.
        """
        if record.steps and not math.isfinite(record.mean_cost):
            raise NotFinite(f"mean_cost of episode {record.index} is {record.mean_cost}; wanted a finite number")
        failed = record.outcome is Outcome.FAILURE
        if failed:
            self._add_failure(record)
        self.episodes += 1
        self.rejected += record.outcome is Outcome.REJECTED
        self.raw_collisions += failed or record.outcome is Outcome.DEGENERATE
        self.artefacts += record.collision is not None and record.collision.artefact
        self.environment_steps += record.steps
        self.cost += record.mean_cost * record.steps if record.steps else 0.0
        if record.outcome is Outcome.INVALID:
            self.invalid += 1
            return
        # A rejected scene counts T although it took 0 steps; else a search would gain by proposing impossible scenes.
        self.steps_to_failure += record.steps if failed else self.horizon_steps
        self._newest.append((failed, preventable(record)))
        self.newest_episodes = len(self._newest)
        self.newest_failures, self.newest_preventable = map(sum, zip(*self._newest, strict=True))

    def _add_failure(self, record: EpisodeRecord) -> None:
        if record.collision is None:
            raise ValueError(f"episode {record.index} is a failure without a collision; wanted its collision record")
        features = outcome_features(record.collision)
        judged = record.collision.judgement
        times_s = [record.collision.time_s, *([judged.conflict_s] if judged else [])]
        if not all(map(math.isfinite, times_s)):
            striker = record.collision.other_id
            raise NotFinite(f"collision with {striker!r} and its conflict are at {times_s} s; wanted finite times")
        new = self._distinct.add(record.collision)  # the last that may refuse it
        self._spread.add(features)
        self.distance = self._spread.distance
        self.failures += 1
        self.distinct_failures += new
        self.preventable += record.collision.preventable
        self.avoidable += record.collision.avoidable
        if record.collision.preventable:  # whichever of its kind came first
            self.distinct_preventable += self._distinct_preventable.add(record.collision)
        if judged is not None:
            self.kinds.add(kind_of(record.collision, judged))
            self.unresponsive += judged.unresponsive
            self.signatures[judged.signature] += 1
            self.conflicts_by_second[self._second(judged.conflict_s)] += 1
            self.contacts_by_second[self._second(record.collision.time_s)] += 1

    def _second(self, time_s: float) -> int:
        """The bin of a time; what began before the release is in the first, and the horizon's end in the last."""
        return min(max(0, math.floor(time_s)), len(self.contacts_by_second) - 1)
