"""Builds a campaign's test cases, one per scenario, after ISO 34505."""

from collections.abc import Iterator, Mapping, Sequence

from risk_sac.config import CampaignSpec, FamilyName, Interval, JudgeConfig, Requirement, Scenario, method_of
from risk_sac.config.distribution import HistogramLaw, NumberLaw, WeightsLaw
from risk_sac.errors import ConfigError
from risk_sac.metrics import pooled_headline
from risk_sac.records import EpisodeRecord, Outcome, TriageState, assessment
from risk_sac.report.comparison import Comparison
from risk_sac.report.files import sha256
from risk_sac.report.matrix import definitions_of
from risk_sac.report.runs import FinishedRun, versions_of
from risk_sac.report.standards import CLAUSES, SceneFacts, functional_of
from risk_sac.scenario.families import document_named, family_named, sources_named
from risk_sac.scenario.layout import LEAD_IN_S
from risk_sac.scenario.odd import field, paths
from risk_sac.world.types import STEP_S

CRASHED = "sim_crash"  # the reason of an episode that was left out because the simulator died in it
TRAFFIC = {"iid-undisturbed": "undisturbed traffic", "iid-random": "random adversaries"}
FIGURES = (
    assessment.FigureNote(
        figure="episodes, refused, contacts, failures, kinds, cells of the coverage",
        kind="count",
        rests_on="the recorded episodes, each judged by written definitions",
        does_not_show="how often anything happens: a search chose the scenes",
    ),
    assessment.FigureNote(
        figure="headline failures, verified",
        kind="count",
        rests_on="failures that were the same to the bit when replayed",
        does_not_show="failures that the budget did not find",
    ),
    assessment.FigureNote(
        figure="bounds of the i.i.d. phase",
        kind="estimate",
        rests_on="independent draws of scenes; Clopper and Pearson, one-sided, 95 %",
        does_not_show="a rate on the road: no road has these scenes in these shares",
    ),
    assessment.FigureNote(
        figure="rates of requirements and PCR in the funnel, with Wilson's interval",
        kind="estimate",
        rests_on="episodes of a search as if they were independent, which they are not",
        does_not_show="a rate in any traffic; the interval is for comparing methods",
    ),
    assessment.FigureNote(
        figure="power: known faults that the budget detects",
        kind="estimate",
        rests_on="runs of a benchmark with other egos, in which faults were planted",
        does_not_show="anything of this ego",
    ),
    assessment.FigureNote(
        figure="preventable, fault, severity, plausibility",
        kind="model",
        rests_on="reference drivers, written rules and published distributions",
        does_not_show="what a person would have done, or an injury",
    ),
    assessment.FigureNote(
        figure="processor seconds",
        kind="measurement",
        rests_on="the machine of the runs",
        does_not_show="times on another machine",
    ),
)
CLAUSE_ROWS = tuple(assessment.ClauseRow(field=row.field, standard=row.standard, clause=row.clause) for row in CLAUSES)


def reported_cases(
    comparison: Comparison,
    requirements: Mapping[FamilyName, tuple[Requirement, ...]],
    estimates: Mapping[FamilyName, tuple[assessment.CaseEstimate, ...]],
    people: Mapping[TriageState, int] | None,
) -> Iterator[assessment.ReportedCase]:
    """Yields a test case for each readable scenario of a campaign.

    `estimates` are bounds of the i.i.d. phases; `people`, failures by what people made of them, or None if not known.
    """
    spec = comparison.spec
    for name in spec.families:
        try:
            document, facts, sources = document_named(name), SceneFacts(name, spec.odd), sources_named(name)
        except (ConfigError, OSError):
            continue  # the report names a lost scenario elsewhere
        runs = [run for run in (*comparison.runs, *comparison.drawn) if run.spec.family == name]
        searches = [run for run in runs if not run.spec.iid]
        records = [record for run in searches for record in run.records]
        criteria = requirements.get(name, ())
        yield assessment.ReportedCase(
            identifier=f"{name}-{spec.digest[:12]}",
            scenario=name,
            summary=document.summary,
            sources={file: sha256(content) for file, content in sources.items()},
            tags=document.tags,
            functional_scenarios=tuple(", ".join(one) for one in functional_of(document.tags)),
            objective=_objective(spec, criteria),
            preconditions=tuple(_preconditions(spec, document)),
            odd={path: allowed(field(facts.odd, path)) for path in paths(facts.odd)},
            inputs=tuple(_inputs(document, facts)),
            constraints=tuple(map(str, document.constraints)),
            steps=tuple(_steps(spec, name, document)),
            platform=versions_of(runs),
            pass_criteria=criteria,
            result=_result(searches, records, criteria),
            estimates=estimates.get(name, ()),
            recording=tuple(_recorded(run) for run in runs),
            judged_by=assessment.CaseJudges(
                definitions=definitions_of(records), drivers=_drivers(spec, name), people=people
            ),
        )


def allowed(value: object) -> str:
    """Returns a value of the ODD in words."""
    if isinstance(value, Interval):
        return f"{value.low:g}" if value.low == value.high else f"{value.low:g} to {value.high:g}"
    if isinstance(value, tuple):
        return ", ".join(map(str, value))
    return "anything" if value is None else str(value)


def law_in_words(law: "NumberLaw | WeightsLaw | None") -> str:
    """Returns a distribution in words; uniform without one."""
    if law is None:
        return "uniform"
    if isinstance(law, WeightsLaw):
        return f"weights {', '.join(f'{weight:g}' for weight in law.weights)}"
    if isinstance(law, HistogramLaw):
        return f"histogram of {len(law.bins)} bins"
    values = ", ".join(
        f"{name.replace('_', ' ')} {value:g}" for name, value in law.model_dump(exclude={"kind"}).items()
    )
    return f"{law.kind}, {values}"


def _objective(spec: CampaignSpec, criteria: Sequence[Requirement]) -> str:
    names = [one.name for one in criteria if one.counts == "failure"]
    return f"Find scenes in which {spec.ego.name} violates {' or '.join(names) or 'a requirement'}."


def _preconditions(spec: CampaignSpec, document: Scenario) -> Iterator[str]:
    ego, version = spec.ego.name, spec.ego.version
    yield f"The ego is {ego}{f', version {version}' if version else ''}; it responds within {spec.ego.response_s:g} s."
    sensor = spec.ego.sensor
    if sensor is None:
        yield "The ego sees everything."
    else:
        hidden = "vehicles hide what is behind them" if sensor.occlusion else "nothing is hidden"
        yield f"The ego sees {sensor.range_m:g} m far; {hidden}."
    roles: dict[str, list[str]] = {}
    for name, actor in document.actors.items():
        roles.setdefault(actor.role, []).append(name)
    for role, names in roles.items():
        yield f"Actors of the role {role}: {', '.join(names)}."
    if document.streams:
        yield f"Streams of background traffic: {', '.join(document.streams)}."


def _inputs(document: Scenario, facts: SceneFacts) -> Iterator[assessment.CaseInput]:
    for parameter in facts.space.parameters:
        own = document.parameters.get(parameter.name)
        law = own.distribution if own else None
        yield assessment.CaseInput(
            **{name: getattr(parameter, name) for name in ("name", "unit", "meaning", "low", "high")},
            words=(own.words if own else None) or parameter.categories,
            distribution=law_in_words(law),
            declared=law is not None,
        )


def _steps(spec: CampaignSpec, name: FamilyName, document: Scenario) -> Iterator[str]:
    methods = "; ".join(f"{method}: {method_of(method).summary}" for method in spec.methods)
    yield "Choose the inputs of a scene within their ranges; refuse it if it breaks a constraint or cannot be played."
    told = "the scenario's story begins at once" if document.story else f"SUMO drives them for {LEAD_IN_S:g} s"
    yield f"Place all actors; {told}."
    yield f"Release the ego and the adversaries. Methods: {methods}"
    yield f"Monitor the pass criteria every {STEP_S:g} s."
    yield f"End at a contact, or after {family_named(name).horizon_steps * STEP_S:g} s."
    yield "Judge each violation: valid, preventable, fault, severity, plausibility, kind."
    yield f"Repeat for {spec.budget.episodes} episodes with each method and seed; replay the first failure of a kind."


def _result(
    runs: Sequence[FinishedRun], records: Sequence[EpisodeRecord], criteria: Sequence[Requirement]
) -> assessment.CaseResult:
    unended = sum(record.outcome is Outcome.INVALID or record.reason == CRASHED for record in records)
    refused = sum(record.outcome is Outcome.REJECTED and record.reason != CRASHED for record in records)
    failures = sum(record.outcome is Outcome.FAILURE for record in records)
    valid = [violation for record in records for violation in record.valid_violations]
    played = len(records) - unended - refused
    counted = {one.name for one in criteria if one.counts == "failure"}
    violated = {
        one.name: sum(
            one.name in record.failed
            if one.name in counted
            else (result := record.requirements.get(one.name)) is not None and result.violated_s is not None
            for record in records
        )
        for one in criteria
    }
    return assessment.CaseResult(
        verdict="failed" if failures else "no_failure_found" if played else "not_played",
        episodes=len(records),
        refused=refused,
        unended=unended,
        played=played,
        contacts=sum(record.collision is not None for record in records),
        failures=failures,
        kinds=len({violation.kind for violation in valid}),
        preventable=len({violation.kind for violation in valid if violation.preventable}),
        published=len({violation.kind for violation in valid if violation.published_preventable}),
        headline=pooled_headline(metrics for run in runs for metrics in run.metrics.values()),
        violated=violated,
    )


def _recorded(run: FinishedRun) -> assessment.CaseRun:
    repeated = run.verified.episodes.values() if run.verified else None
    return assessment.CaseRun(
        id=run.spec.id,
        method=run.spec.method,
        seed=run.spec.seed,
        phases=tuple(run.metrics),
        episodes=len(run.records),
        cpu_s=run.cpu_s,
        digest=run.digest,
        spec_digest=run.spec.digest,
        replayed=None if repeated is None else len(repeated),
        verified=None if repeated is None else sum(one.verified for one in repeated),
    )


def _drivers(spec: CampaignSpec, name: FamilyName) -> tuple[str, ...]:
    own = family_named(name).judge
    return (spec.judge if own is None or spec.judge != JudgeConfig() else own).drivers
