"""Gathers a report's data: funnel, bounds, coverage, test cases, digests of inputs.

Coverage of the search and of that phase are kept apart, but for the matrix, which says what was played at all.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from risk_sac.config import CampaignSpec, FamilyName, IidName, Requirement
from risk_sac.errors import ConfigError
from risk_sac.failures.cases import Regression
from risk_sac.failures.clusters import Overview
from risk_sac.metrics import clopper_pearson, pooled_requirements, preventable, published
from risk_sac.records import EpisodeRecord, Outcome, Power, Record, TriageState
from risk_sac.records.assessment import CaseEstimate, ClauseRow, CoverageMatrix, FigureNote, ReportedCase, SignedInputs
from risk_sac.report.comparison import Cell, Comparison
from risk_sac.report.coverage import NOT_PLAYED, Coverage, coverage
from risk_sac.report.matrix import coverage_matrix
from risk_sac.report.power import played_by, power_of
from risk_sac.report.reported_cases import CLAUSE_ROWS, CRASHED, FIGURES, TRAFFIC, reported_cases
from risk_sac.report.runs import FinishedRun
from risk_sac.report.signing import input_digests, signed
from risk_sac.scenario.families import family_named


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignFacts:
    """Facts of a campaign that its finished runs do not tell."""

    id: str = ""  # the first digits of the digest of its spec if empty
    folders: tuple[Path, ...] = ()  # of its runs, to be digested
    requirements: Mapping[FamilyName, tuple[Requirement, ...]] = field(default_factory=dict)  # by scenario
    code: str = ""  # SHA-256 over the sources
    regression: Regression | None = None
    people: Mapping[TriageState, int] | None = None  # failures by what people made of them


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
    """Evidence of a campaign: every number of its report."""

    complete: bool
    """Whether all runs are in it."""
    spec: CampaignSpec
    campaign: str
    """Digest of the spec."""
    headline: int | None
    """Failures of all searches; what several found alike counts once. Null before one was replayed."""
    headline_published: int | None
    """Of these, those that R157, FSM or RSS prevents."""
    cells: tuple[Cell, ...]
    """The funnel by family, phase and method."""
    kinds: Mapping[FamilyName, Overview]
    """Kinds of failures that all methods found together."""
    power: Power
    """What finding nothing is worth."""
    bounds: tuple[Drawn, ...]
    """Of the i.i.d. phase alone; none without one, however much was searched."""
    coverage: Mapping[FamilyName, FamilyCoverage]
    """Of the families with a finished run."""
    matrix: CoverageMatrix
    cases: tuple[ReportedCase, ...]
    """Test cases after ISO 34505, one for each scenario."""
    clauses: tuple[ClauseRow, ...]
    """Where standards ask for the fields of a test case."""
    figures: tuple[FigureNote, ...]
    """Which figures are estimates, and what they do not show."""
    signed: SignedInputs


NO_FACTS = CampaignFacts()


def gathered(comparison: Comparison, facts: CampaignFacts = NO_FACTS) -> CampaignEvidence:
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
    bounds = tuple(map(drawn, comparison.drawn))
    estimates = {name: tuple(_estimate(one) for one in bounds if one.family == name) for name in spec.families}
    regression = facts.regression.model_dump_json() if facts.regression else ""
    return CampaignEvidence(
        complete=not comparison.missing and not comparison.undrawn,
        spec=spec,
        campaign=spec.digest,
        headline=comparison.headline,
        headline_published=comparison.headline_published,
        cells=comparison.cells,
        kinds=comparison.overviews,
        power=power_of(spec, played_by(comparison.runs)),
        bounds=bounds,
        coverage=coverage_by_family,
        matrix=coverage_matrix(comparison, facts.id),
        cases=tuple(reported_cases(comparison, facts.requirements, estimates, facts.people)),
        clauses=CLAUSE_ROWS,
        figures=FIGURES,
        signed=signed(input_digests(spec, facts.folders, code=facts.code, regression=regression)),
    )


def _estimate(bounds: Drawn) -> CaseEstimate:
    failures = bounds.failures
    return CaseEstimate(
        figure=f"failures per scene with {TRAFFIC[bounds.method]}, {bounds.played} scenes played",
        value=failures.count / bounds.played if bounds.played else 0.0,
        low=failures.low,
        high=failures.high,
        level="95 %, one-sided each, Clopper and Pearson",
        shows="the failure probability of scenes drawn as stated, in this simulator",
        does_not_show="a rate on the road, or with other adversaries",
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
