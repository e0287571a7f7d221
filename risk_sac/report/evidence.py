"""Gathers a report's data: bounds of the i.i.d. phase, and coverage.

Coverage of the search and of that phase are kept apart.
"""

from collections.abc import Iterable, Mapping, Sequence

from risk_sac.config import FamilyName, IidName
from risk_sac.errors import ConfigError
from risk_sac.metrics import clopper_pearson, pooled_requirements, preventable, published
from risk_sac.records import EpisodeRecord, Outcome, Record
from risk_sac.report.comparison import Comparison
from risk_sac.report.coverage import NOT_PLAYED, Coverage, coverage
from risk_sac.report.runs import FinishedRun
from risk_sac.scenario.families import family_named

CRASHED = "sim_crash"  # the reason of an episode that was left out because the simulator died in it


class Bound(Record):
    """Count of an event, and 95 % bounds of its rate."""

    count: int
    low: float
    """Clopper-Pearson, one-sided."""
    high: float
    """The same; it happened in an episode without an end."""


class RequirementBound(Record):
    """Count of a requirement's violations, with bounds."""

    counts: str
    """failure | report"""
    violated: int
    """Episodes."""
    bound: Bound
    """Of valid violations; of one that is reported only, of all."""


class Drawn(Record):
    """Results of the scenes of one family and one kind of traffic."""

    family: FamilyName
    method: IidName
    seed: int
    scenes: int
    """That were drawn."""
    refused: int
    """By C_hard, before the first step: of these scenes nothing is said."""
    unended: int
    """In which the simulator died, or the ego failed to drive, so that the outcome is unknown."""
    played: int
    """All others."""
    contacts: Bound
    failures: Bound
    """Of any requirement that counts."""
    preventable: Bound
    """By a reference driver."""
    published: Bound
    """Of these, by R157, FSM or RSS."""
    requirements: Mapping[str, RequirementBound]
    """Requirement → its funnel."""


class FamilyCoverage(Record):
    """Coverage of one family by searches and by the i.i.d. phase."""

    search: Coverage
    """By all searches together, the evaluation of frozen policies among them."""
    iid: Coverage | None
    """By the i.i.d. phase; null without one."""

    @property
    def phases(self) -> Mapping[str, Coverage]:
        """Coverage by name of its phase."""
        return {"search": self.search} | ({"i.i.d. phase": self.iid} if self.iid else {})

    @property
    def never_bins(self) -> Mapping[str, Sequence[str]]:
        """Parameter → its bins without an episode of either phase; parameters without such a bin are left out."""
        both = zip(*(phase.parameters for phase in self.phases.values()), strict=True)
        never = {one.name: [name for name in one.never if all(name in of.never for of in more)] for one, *more in both}
        return {name: bins for name, bins in never.items() if bins}

    @property
    def never_cells(self) -> Mapping[tuple[str, str], Sequence[str]]:
        """Pair of parameters → its cells without an episode of either phase, the most first."""
        both = zip(*(phase.pairs for phase in self.phases.values()), strict=True)
        never = {
            one.parameters: [cell for cell in one.never if all(cell in of.never for of in more)] for one, *more in both
        }
        return {pair: never[pair] for pair in sorted(never, key=lambda pair: -len(never[pair])) if never[pair]}


class CampaignEvidence(Record):
    """Evidence of a campaign on its ego's failure rate, and its coverage."""

    complete: bool
    """Whether all runs are in it."""
    bounds: tuple[Drawn, ...]
    """Of the i.i.d. phase alone; none without one, however much was searched."""
    coverage: Mapping[FamilyName, FamilyCoverage]
    """Of the families with a finished run."""


def gathered(comparison: Comparison) -> CampaignEvidence:
    """Gather the evidence of the runs that have finished."""
    spec = comparison.spec
    coverage_by_family: dict[FamilyName, FamilyCoverage] = {}
    for family in spec.families:
        searched, fresh = _records(comparison.runs, family), _records(comparison.drawn, family)
        if searched or fresh:
            coverage_by_family[family] = FamilyCoverage(
                search=coverage(family_named(family), spec.odd, searched),
                iid=coverage(family_named(family), spec.odd, fresh) if fresh else None,
            )
    return CampaignEvidence(
        complete=not comparison.missing and not comparison.undrawn,
        bounds=tuple(map(drawn, comparison.drawn)),
        coverage=coverage_by_family,
    )


def _records(runs: Iterable[FinishedRun], family: FamilyName) -> list[EpisodeRecord]:
    return [record for run in runs if run.spec.family == family for record in run.records]


def drawn(run: FinishedRun) -> Drawn:
    """Bound the rates of one run of an i.i.d. phase.

    Given how many scenes were refused, the others are independent draws from those that are not, so that the binomial
    distribution holds exactly.

    Raises:
      ConfigError: an episode of the run belongs to another phase.
    """
    if other := {record.phase for record in run.records} - {"iid"}:
        got = f"{run.spec.id} with episodes of the phase {min(other)!r}"
        raise ConfigError("", got, "those of its own alone")
    played = [record for record in run.records if record.outcome not in NOT_PLAYED]
    unended = sum(record.outcome is Outcome.INVALID or record.reason == CRASHED for record in run.records)

    def bound(count: int) -> Bound:
        trials = len(played) + unended
        low, high = clopper_pearson(count, trials)[0], clopper_pearson(count + unended, trials)[1]
        return Bound(count=count, low=low, high=high)

    counted = pooled_requirements(list(run.metrics.values()))
    requirements = {
        name: RequirementBound(counts=each.counts, violated=each.violated, bound=bound(each.in_rate))
        for name, each in counted.items()
    }
    return Drawn.model_validate(
        {
            **{name: getattr(run.spec, name) for name in ("family", "method", "seed")},
            "scenes": len(run.records),
            "refused": len(run.records) - len(played) - unended,
            "unended": unended,
            "played": len(played),
            "contacts": bound(sum(record.collision is not None for record in played)),
            "failures": bound(sum(record.outcome is Outcome.FAILURE for record in played)),
            "preventable": bound(sum(map(preventable, played))),
            "published": bound(sum(map(published, played))),
            "requirements": requirements,
        }
    )
