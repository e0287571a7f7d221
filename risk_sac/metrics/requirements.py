"""The funnel of each requirement: counted over a run's episodes, and pooled over runs."""

from collections.abc import Sequence

from risk_sac.metrics.intervals import wilson_interval
from risk_sac.records import Collision, RequirementCounts, RunMetrics, Violation
from risk_sac.verdicts.distinct import DistinctFailures

STEPS = ("violated", "valid", "distinct", "preventable")
COLUMNS = ("requirement", "counts", *STEPS, "rate (95 %)")


class RequirementTally:
    """Counts the episodes that violated one requirement."""

    def __init__(self, counts: str) -> None:
        self._counts = counts
        self.violated = self._valid = 0
        self._distinct, self._preventable = DistinctFailures(), DistinctFailures()

    def add(self, violation: Collision | Violation) -> tuple[bool, bool]:
        """Counts a valid violation; returns whether it is distinct, and distinct among the preventable ones."""
        new = self._distinct.add(violation)  # the only one that may refuse it
        self._valid += 1
        return new, violation.preventable and self._preventable.add(violation)

    def counts(self, rated: int) -> RequirementCounts:
        """The funnel so far, given the episodes that rates are taken over."""
        steps = (self.violated, self._valid, self._distinct.count, self._preventable.count)
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


def requirement_cells(name: str, found: RequirementCounts) -> list[str]:
    """The cells of a requirement's row, under `COLUMNS`; a dash where nothing is judged."""
    judged = (found.valid, found.distinct, found.preventable)
    steps = map(str, judged) if found.counts == "failure" else "–––"
    rate = f"{found.rate:.3f} [{found.rate_low:.3f}, {found.rate_high:.3f}]"
    return [name, found.counts, str(found.violated), *steps, rate]


def _funnel(counts: str, steps: Sequence[int], rated: int) -> RequirementCounts:
    funnel = dict(zip(STEPS, steps, strict=True))
    hits = funnel["valid" if counts == "failure" else "violated"]
    low, high = wilson_interval(hits, rated)
    return RequirementCounts(counts=counts, **funnel, rate=hits / max(1, rated), rate_low=low, rate_high=high)
