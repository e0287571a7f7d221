"""Counts the episodes of a run by outcome and requirement."""

import math
from collections import Counter, deque
from collections.abc import Sequence
from typing import Annotated

from pydantic import ConfigDict, Field, PrivateAttr

from risk_sac.errors import NotFinite
from risk_sac.metrics.metric import Spread, outcome_features, wilson_interval
from risk_sac.records import (
    PUBLISHED,
    Collision,
    Counts,
    EpisodeRecord,
    Outcome,
    RequirementCounts,
    RunMetrics,
    Violation,
)
from risk_sac.verdicts.distinct import DistinctFailures, TaxonomyCell, taxonomy_cell, variant_name
from risk_sac.world.types import STEP_S

STEPS = ("violated", "valid", "distinct", "preventable", "published")
COLUMNS = ("requirement", "counts", *STEPS, "rate (95 %)")


class RequirementTally:
    """Counts the episodes that violated one requirement."""

    def __init__(self, counts: str) -> None:
        self._counts = counts
        self.violated = self._valid = 0
        self._distinct, self._preventable, self._published = (DistinctFailures() for _ in range(3))

    def add(self, violation: Collision | Violation) -> tuple[bool, bool, bool]:
        """Counts a valid violation.

        Returns whether it is the first of its kind: of all, of the preventable ones, and of those that R157, FSM or RSS
        prevents.
        """
        self._valid += 1
        return (
            self._distinct.add(violation),
            violation.preventable and self._preventable.add(violation),
            violation.published_preventable and self._published.add(violation),
        )

    def counts(self, rated: int) -> RequirementCounts:
        """The funnel so far, given the episodes that rates are taken over."""
        kinds = (self._distinct.count, self._preventable.count, self._published.count)
        steps = (self.violated, self._valid, *kinds)
        return _funnel(self._counts, steps, rated)


def pooled_requirements(metrics: Sequence[RunMetrics]) -> dict[str, RequirementCounts]:
    """The funnel of each requirement, summed over the runs that have it."""
    pooled = {}
    for name in dict.fromkeys(name for each in metrics for name in each.requirements):
        having = [each for each in metrics if name in each.requirements]
        own = [each.requirements[name] for each in having]
        steps = [sum(getattr(each, step) for each in own) for step in STEPS]
        pooled[name] = _funnel(own[-1].counts, steps, sum(each.rated for each in having))
    return pooled


def requirement_cells(name: str, requirement: RequirementCounts) -> list[str]:
    """Formats a requirement's row under `COLUMNS`; a dash where nothing is judged."""
    judged = (requirement.valid, requirement.distinct, requirement.preventable, requirement.published)
    steps = map(str, judged) if requirement.counts == "failure" else "––––"
    rate = f"{requirement.rate:.3f} [{requirement.rate_low:.3f}, {requirement.rate_high:.3f}]"
    return [name, requirement.counts, str(requirement.violated), *steps, rate]


def with_published(count: int | None, published: int | None) -> str:
    """Formats a count, in brackets those that R157, FSM or RSS prevents."""
    return "–" if count is None else f"{count:,} ({published or 0:,})"


def _funnel(counts: str, steps: Sequence[int], rated: int) -> RequirementCounts:
    funnel = dict(zip(STEPS, steps, strict=True))
    hits = funnel["valid" if counts == "failure" else "violated"]
    low, high = wilson_interval(hits, rated)
    return RequirementCounts(counts=counts, **funnel, rate=hits / max(1, rated), rate_low=low, rate_high=high)


STEPS_PER_S = round(1 / STEP_S)
WINDOW = 100  # number of episodes of the sliding ECR and PCR


def preventable(record: EpisodeRecord) -> bool:
    """Whether a reference driver would have prevented one of the valid violations."""
    return any(violation.preventable for violation in record.valid_violations)


def published(record: EpisodeRecord) -> bool:
    """Whether R157, FSM or RSS would have prevented a valid violation."""
    return any(violation.published_preventable for violation in record.valid_violations)


class Tally(Counts):
    """Counts and sums of a run.

    The cost per episode grows only with the number of failures.
    """

    model_config = ConfigDict(frozen=False)

    horizon_steps: Annotated[int, Field(ge=1)]
    """T."""
    steps_to_failure: int = 0
    """Summed over episodes; T for one without a valid contact."""
    cost: float = 0.0
    """Realism cost C_soft, summed over executed steps."""
    distance: float = 0.0
    """Between two valid contacts' outcome features, summed over all pairs."""
    newest_episodes: int = 0
    """`WINDOW`, or all where there are fewer."""
    newest_failures: int = 0
    """Valid contacts among them."""
    newest_preventable: int = 0
    """Those that a reference driver would have prevented."""
    episodes_driven_by: Counter[str] = Field(default_factory=Counter)
    """What drove the adversaries → episodes."""
    prevented_by: Counter[str] = Field(default_factory=Counter)
    """Reference driver, or `published` → valid contacts that it would have prevented."""
    by_severity: Counter[str] = Field(default_factory=Counter)
    """Severity → valid contacts."""
    by_fault: Counter[str] = Field(default_factory=Counter)
    """Fault → failures, each by its worst violation."""
    kinds: Counter[str] = Field(default_factory=Counter)
    """Kind → valid violations."""
    taxonomy: set[TaxonomyCell] = Field(default_factory=set)
    """Of the valid contacts."""
    conflicts_by_second: list[int] = Field(default_factory=list)
    """Valid contacts by the second in which they began."""
    contacts_by_second: list[int] = Field(default_factory=list)
    """The same by the second of the contact."""
    _candidates: DistinctFailures = PrivateAttr(default_factory=DistinctFailures)
    _implausible: DistinctFailures = PrivateAttr(default_factory=DistinctFailures)
    _variants: set[str] = PrivateAttr(default_factory=set)
    _newest: deque[tuple[bool, bool]] = PrivateAttr(default_factory=lambda: deque(maxlen=WINDOW))
    _spread: Spread = PrivateAttr(default_factory=Spread)
    _requirements: dict[str, RequirementTally] = PrivateAttr(default_factory=dict)
    _measured: bool = PrivateAttr(default=False)  # whether a record tells of requirements; older ones do not

    def model_post_init(self, context: object, /) -> None:
        """Make a bin for every second that is begun."""
        super().model_post_init(context)
        seconds = math.ceil(self.horizon_steps / STEPS_PER_S)
        self.conflicts_by_second, self.contacts_by_second = [0] * seconds, [0] * seconds

    def add(self, record: EpisodeRecord) -> None:
        """Count one more episode.

        Raises:
            NotFinite: its mean cost, or when its conflict or contact was, is not finite, or an outcome feature is NaN.
            ValueError: it is a failure without a valid violation.
        """
        if record.steps and not math.isfinite(record.mean_cost):
            raise NotFinite(f"mean_cost of episode {record.index} is {record.mean_cost}; wanted a finite number")
        collision = record.collision
        failed = record.outcome is Outcome.FAILURE
        struck = collision if failed and collision is not None and collision.valid else None
        for name, result in record.requirements.items():  # in their order
            self._requirement(name, result.counts)
            self._measured = True
        if failed:
            if not record.valid_violations:
                raise ValueError(f"episode {record.index} is a failure without a valid violation")
            if struck is not None:
                self._add_collision(struck)
            self._add_violations(record)
        for name, result in record.requirements.items():
            self._requirements[name].violated += result.violated_s is not None
        self.episodes += 1
        if record.driven_by is not None:
            self.episodes_driven_by[record.driven_by] += 1
        self.rejected += record.outcome is Outcome.REJECTED
        self.raw_collisions += collision is not None
        self.artefacts += collision is not None and collision.artefact
        self.environment_steps += record.steps
        self.cost += record.mean_cost * record.steps if record.steps else 0.0
        if record.outcome is Outcome.INVALID:
            self.invalid += 1
            return
        # A rejected scene counts T although it took 0 steps; else a search would gain by proposing impossible scenes.
        self.steps_to_failure += self.horizon_steps if struck is None else record.steps
        self._newest.append((struck is not None, struck is not None and struck.preventable))
        self.newest_episodes = len(self._newest)
        self.newest_failures, self.newest_preventable = map(sum, zip(*self._newest, strict=True))

    def requirement_counts(self) -> dict[str, RequirementCounts]:
        """Requirement → its funnel, in order of first appearance; empty without records."""
        return {name: each.counts(self.rated) for name, each in self._requirements.items()} if self._measured else {}

    def _add_violations(self, record: EpisodeRecord) -> None:
        self.failures += 1
        self.preventable += preventable(record)
        if record.worst_violation is not None and record.worst_violation.blamed is not None:
            self.by_fault[record.worst_violation.blamed] += 1
        for violation in record.valid_violations:
            new, preventable_kind, published_kind = self._requirement(violation.requirement, "failure").add(violation)
            self.distinct_failures += new
            self.distinct_preventable += preventable_kind
            self.distinct_published += published_kind
            self.headline_candidates += violation.headline_candidate and self._candidates.add(violation)
            self.implausible += violation.serious and not violation.plausible and self._implausible.add(violation)
            self.kinds[violation.kind] += 1
            self._variants.add(variant_name(violation))
        self.variants = len(self._variants)

    def _requirement(self, name: str, counts: str) -> RequirementTally:
        return self._requirements.setdefault(name, RequirementTally(counts))

    def _add_collision(self, collision: Collision) -> None:
        features = outcome_features(collision)
        judged = collision.judgement
        times_s = [collision.time_s, judged.conflict_s]
        if not all(map(math.isfinite, times_s)):
            striker = collision.other_id
            raise NotFinite(f"collision with {striker!r} and its conflict are at {times_s} s; wanted finite times")
        self._spread.add(features)
        self.distance = self._spread.distance
        self.collisions += 1
        self.preventable_collisions += collision.preventable
        self.avoidable += collision.avoidable
        prevented = {name: int(prevents) for name, prevents in collision.prevention.items()}
        if prevented:
            prevented["published"] = max(prevented.get(name, 0) for name in PUBLISHED)
        self.prevented_by.update(prevented)
        self.by_severity[judged.severity] += 1
        self.taxonomy.add(taxonomy_cell(collision))
        self.unresponsive += judged.unresponsive
        self.conflicts_by_second[self._second(judged.conflict_s)] += 1
        self.contacts_by_second[self._second(collision.time_s)] += 1

    def _second(self, time_s: float) -> int:
        """Returns the bin of a time.

        What began before the release is in the first, and the horizon's end in the last.
        """
        return min(max(0, math.floor(time_s)), len(self.contacts_by_second) - 1)
