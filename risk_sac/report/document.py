"""Gathers a campaign's evidence, and writes it as a report.

That is funnel, bounds, coverage and digests of inputs.

Coverage of the search and of the i.i.d. phase are kept apart, but for the matrix, which says what was played at all.
"""

import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from risk_sac.config import IID_METHODS, CampaignSpec, FamilyName, IidName, Requirement
from risk_sac.config.spec_file import campaign_yaml
from risk_sac.errors import ConfigError, DamagedError, RiskSacError
from risk_sac.failures.net import roads_of, signal_heads, thumbnail
from risk_sac.failures.recording import Recording
from risk_sac.failures.studied import Regression
from risk_sac.metrics import clopper_pearson, pooled_requirements, preventable, published
from risk_sac.records import Collision, EpisodeRecord, Outcome, Power, Record, TriageState, Violation
from risk_sac.records.assessment import CaseEstimate, ClauseRow, CoverageMatrix, FigureNote, ReportedCase, SignedInputs
from risk_sac.report.comparison import Cell, Comparison
from risk_sac.report.coverage import NOT_PLAYED, Coverage, coverage
from risk_sac.report.files import input_digests, manifest, signed
from risk_sac.report.matrix import coverage_matrix
from risk_sac.report.rendering import Layout, render
from risk_sac.report.reported_cases import CLAUSE_ROWS, CRASHED, FIGURES, TRAFFIC, allowed, reported_cases
from risk_sac.report.runs import Cluster, FinishedRun, Overview
from risk_sac.report.statistics import played_by, power_of
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, RecordedFailure, series_name
from risk_sac.scenario.families import Family, family_named
from risk_sac.scenario.odd import field as odd_field
from risk_sac.scenario.odd import intersect, paths


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
        """Parameter → its bins without an episode of either phase, if any."""
        both = zip(*(phase.parameters for phase in self.phases.values()), strict=True)
        never = {one.name: [name for name in one.never if all(name in of.never for of in more)] for one, *more in both}
        return {name: bins for name, bins in never.items() if bins}

    @property
    def never_cells(self) -> Mapping[tuple[str, str], Sequence[str]]:
        """Pair of parameters → its cells without an episode, most cells first."""
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


MOST_KINDS = 12  # pictured, of a family
# Filter of jq: what a card says of the contact by the difference of two times.
CARD_TIMES = ".collision // empty | {conflict_to_contact_s: (.time_s - .judgement.conflict_s)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Runs' folders and commands to type, known only to the caller."""

    report: str  # the command that makes this report
    data: str  # the command that writes all numbers of the report to report.json
    show: Callable[[FinishedRun, str], str]  # of a run and the id of one of its failures: the command that draws it
    regress: str  # the command that plays the failures against another ego
    verify: str = ""  # the command that forms the digest of all inputs again
    record: Callable[[FinishedRun, EpisodeRecord], str] | None = None  # the command that prints an episode's record
    recount: Callable[[FinishedRun], str] | None = None  # of a run: the command that counts the outcomes on record
    folders: Mapping[str, Path] = field(default_factory=dict)  # by digest of the run's spec
    regression: Regression | None = None  # the campaign's failures against another ego, if played


@dataclass(frozen=True, slots=True)
class Drawing:
    """An SVG, or why there is none."""

    svg: bytes | None
    missing: str = ""


DAMAGED = Drawing(None, "its time series or the road net is damaged")


@dataclass(frozen=True, slots=True)
class FailureGroup:
    """A kind of failure, with the episode to look at first."""

    cluster: Cluster
    run: FinishedRun
    record: EpisodeRecord
    violation: Collision | Violation | None  # of this kind
    command: str  # lines that draw the episode, and print its record
    drawing: Drawing


def report_page(
    comparison: Comparison, evidence: CampaignEvidence, origin: Origin, power: Power, layout: Layout
) -> str:
    """Renders the report of all finished runs; `power` is their budget's."""
    families, lost = _families(comparison.spec)
    return render(
        "report",
        layout,
        comparison=comparison,
        spec=comparison.spec,
        evidence=evidence,
        origin=origin,
        power=power,
        families=families,
        lost=lost,
        odd=_odd(comparison.spec, families),
        kinds={name: _kinds(comparison, name, origin) for name in comparison.overviews},
        settings=campaign_yaml(comparison.spec),
        iid_methods=IID_METHODS,
        manifest=manifest,
    )


def show_command(folder: Path, failure: str) -> str:
    """Returns the command that draws a failure of a run's folder."""
    return shlex.join(["risk-sac", "show", str(folder), failure, "--out", "failure.png"])


def _families(spec: CampaignSpec) -> tuple[Mapping[FamilyName, Family], Mapping[FamilyName, str]]:
    """Returns the families of a campaign, and why the others are lost."""
    there: dict[FamilyName, Family] = {}
    lost: dict[FamilyName, str] = {}
    for name in spec.families:
        try:
            there[name] = family_named(name)
        except ConfigError as error:
            lost[name] = str(error)
    return there, lost


def _odd(spec: CampaignSpec, families: Mapping[FamilyName, Family]) -> Mapping[str, list[str]]:
    """Returns what families and campaign allow together, by ODD field."""
    odds = [intersect(family.odd, spec.odd) for family in families.values()]
    return {path: [allowed(odd_field(odd, path)) for odd in odds] for path in (paths(odds[0]) if odds else ())}


def _kinds(comparison: Comparison, family: FamilyName, origin: Origin) -> list[FailureGroup]:
    episodes = {
        record.id_in(run.spec.id): (run, record)
        for run in comparison.runs
        if run.spec.family == family
        for record in run.records
        if record.worst_violation is not None
    }
    kinds = []
    for cluster in comparison.overviews[family].clusters[:MOST_KINDS]:
        run, record = episodes[cluster.representative]
        violation = next((one for one in record.valid_violations if one.kind == cluster.name), None)
        commands = [origin.show(run, cluster.representative)]
        if origin.record is not None:
            commands.append(origin.record(run, record))
        drawing = _draw(run, origin.folders.get(run.spec.digest), record)
        kinds.append(FailureGroup(cluster, run, record, violation, "\n".join(commands), drawing))
    return kinds


def _draw(run: FinishedRun, folder: Path | None, record: EpisodeRecord) -> Drawing:
    """Draws a failure from above, or says what its run's `folder` lacks."""
    if folder is None:
        return Drawing(None, "the folder of its run is missing")
    try:
        series = read_series(folder / FAILURES / series_name(record.index))
        recording = Recording(RecordedFailure.of(run.spec.id, record), series)
        place = run.spec.family, record.scene
        return Drawing(thumbnail(recording, roads_of(*place), signal_heads(*place)).encode())
    except DamagedError:
        return DAMAGED
    except RiskSacError as error:  # of a place on a map
        return Drawing(None, str(error))
    except FileNotFoundError as error:
        lost = "its time series" if str(error.filename or "").endswith(".npz") else "the road net"
        return Drawing(None, f"{lost} is gone")
    except OSError as error:
        return Drawing(None, f"it cannot be read: {error.strerror}")
    except (ValueError, LookupError):
        return DAMAGED
