"""Sections of a report on what the search found."""

from collections.abc import Iterator, Sequence

from risk_sac.config import FamilyName
from risk_sac.failures.clusters import Cluster
from risk_sac.metrics import COLUMNS, requirement_cells
from risk_sac.records import Collision, EpisodeRecord, Power, Violation
from risk_sac.report.cells import Cell
from risk_sac.report.comparison import Comparison
from risk_sac.report.evidence.document import Block, Card, Cards, Commands, Items, Section, Table
from risk_sac.report.evidence.origin import Origin, draw
from risk_sac.report.evidence.words import ego_in_words
from risk_sac.report.markdown import verified
from risk_sac.report.page import DASH, number
from risk_sac.report.runs import FinishedRun
from risk_sac.report.verdicts import class_rows, driven_by_rows, driver_rows
from risk_sac.verdicts.words import began, ego_did, known, prevented_by

MOST_CARDS = 12  # of a family
FUNNEL = [
    *("family", "method", "runs", "headline", "episodes", "refused", "contacts", "valid contacts"),
    *("failures", "distinct", "preventable", "not minor", "verified"),
]


def budget(comparison: Comparison) -> Section:
    """Writes the section on the spent budget."""
    spec = comparison.spec
    allowed = [f"{spec.budget.episodes} search episodes"]
    if spec.budget.evaluation_episodes:
        allowed.append(f"{spec.budget.evaluation_episodes} episodes of the frozen policy")
    if spec.budget.cpu_s is not None:
        allowed.append(f"at most {spec.budget.cpu_s:g} s of processor time for the search")
    rows = [
        [
            family,
            method,
            str(len(of)),
            f"{sum(len(run.records) for run in of):,}",
            f"{sum(run.cpu_s for run in of):,.0f}",
        ]
        for family in spec.families
        for method in comparison.methods
        if (of := comparison.of_cell(family, method))
    ]
    blocks: list[Block] = [
        f"Each run may spend {', and '.join(allowed)}. What was spent:",
        Table("what was spent", ["family", "method", "runs", "episodes", "CPU s"], rows, left=2),
    ]
    return Section("budget", "Budget", blocks)


def funnel(comparison: Comparison) -> Section:
    """Contacts, failures of any requirement down to what is worth a person's time, and each requirement."""
    rows = [
        [
            cell.family,
            cell.method,
            str(len(cell.seeds)),
            number(cell.headline, "d"),
            *(f"{count:,}" for count in (cell.episodes, cell.rejected, cell.raw_collisions, cell.collisions)),
            *(f"{count:,}" for count in (cell.failures, cell.distinct_failures, cell.distinct_preventable)),
            f"{cell.headline_candidates:,}",
            verified(comparison.of_cell(cell.family, cell.method), "search"),
        ]
        for cell in comparison.cells
        if cell.phase == "search"
    ]
    blocks: list[Block] = [
        (
            f"{_counted(found, 'headline failure')} by all methods together: distinct, preventable, not minor, and the "
            "same when replayed. What several runs found alike counts once."
            if (found := comparison.headline) is not None
            else "No run was replayed, so there is no count of headline failures yet (risk-sac verify replays them)."
        ),
        (
            "Refused: the scene was infeasible, and nothing was played. Valid: no artefact of the simulator, and the "
            "ego had a part in it. Failures: episodes with a valid violation of a requirement that counts, contacts "
            "among them. Distinct: violations that resemble no earlier one of the same run; an episode may have "
            "several. Preventable: the distinct ones that a reference driver in the ego's place would have prevented. "
            "Not minor: of these, violations without contact, and contacts whose severity is moderate or severe. "
            "Verified: of the first failures of each kind, those that were the same to the bit each time they were "
            "replayed; a dash where none was. The search chose these scenes: no share of these numbers is a rate of "
            "crashes."
        ),
        Table("the funnel", FUNNEL, rows, left=2),
    ]
    requirements = [
        [cell.family, cell.method, *requirement_cells(name, found)]
        for cell in comparison.cells
        if cell.phase == "search"
        for name, found in cell.requirements.items()
    ]
    if requirements:
        blocks += [
            "By requirement. One that is reported only makes no failure, and its rate is of all violations; that of "
            "another is of valid ones:",
            Table("the funnel by requirement", ["family", "method", *COLUMNS], requirements, left=4),
        ]
    blocks += _verdicts([cell for cell in comparison.cells if cell.phase == "search"])
    return Section("funnel", "The funnel", blocks)


def _verdicts(cells: Sequence[Cell]) -> Iterator[Block]:
    """Yields blocks on prevention by reference drivers, severity and fault."""
    (drivers, pcr), (classes, counts) = driver_rows(cells), class_rows(cells)
    named = [[cell.family, cell.method] for cell in cells]
    if drivers:
        yield (
            "PCR by reference driver: valid contacts that this one would have prevented per episode, with the 95 % "
            "interval of Wilson. full_braking brakes at once, and makes nothing preventable; r157_ttc is a rule for "
            "cut-ins, and is asked of these alone."
        )
        rows = [[*name, *row] for name, row in zip(named, pcr, strict=True)]
        yield Table("PCR by reference driver", ["family", "method", *drivers], rows, left=2)
    if classes:
        yield "Valid contacts by severity, and failures by fault, with the shares of those that were judged:"
        rows = [[*name, *row] for name, row in zip(named, counts, strict=True)]
        yield Table("severity and fault", ["family", "method", *classes], rows, left=2)
    sources, drove = driven_by_rows(cells)
    if sources:
        yield (
            "Episodes by what drove the adversaries, with their share, and headline failures by what drove the first "
            "of their kind: the learner's policy, a script that the script model proposed, another script, or chance."
        )
        rows = [[*name, *row] for name, row in zip(named, drove, strict=True)]
        yield Table("driven by", ["family", "method", *sources], rows, left=2)


def clusters(comparison: Comparison, origin: Origin) -> Section:
    """Writes the section on the kinds of failures, with a picture of each."""
    text = (
        "Contacts of one kind share the striker, the type of conflict, from where, how the ego responds, whether it "
        "saw the other, and the ground; other violations share the requirement, the ego's manoeuvre and the actor that "
        "is next. Pictured is the one to look at first, from above, 3 s long: the ego is blue, "
        "what strikes it orange, others grey."
    )
    parts = [_of_family(comparison, family, origin) for family in comparison.spec.families]
    return Section("failures", "Which failures there are", [text], parts)


def _of_family(comparison: Comparison, family: FamilyName, origin: Origin) -> Section:
    found = comparison.overviews.get(family)
    if found is None or not found.clusters:
        none = "No run of it has finished." if found is None else "None was found. That proves nothing: see the limits."
        return Section(f"failures-{family}", family, [none])
    shown = found.clusters[:MOST_CARDS]
    episodes = {
        record.id_in(run.spec.id): (run, record)
        for run in comparison.runs
        if run.spec.family == family
        for record in run.records
        if record.worst_violation is not None
    }
    rest = len(found.clusters) - len(shown)
    said = f"{_counted(len(found.clusters), 'kind')} by all methods together."
    if rest:
        said += f" {_counted(rest, 'more kind')}, with the fewest preventable failures, left out here."
    cards = [_card(each, *episodes[each.representative], origin) for each in shown]
    return Section(f"failures-{family}", family, [said, Cards(cards)])


def _card(cluster: Cluster, run: FinishedRun, record: EpisodeRecord, origin: Origin) -> Card:
    pictured = next((each for each in record.valid_violations if each.signature == cluster.name), None)
    prevented = pictured and prevented_by(pictured)
    return Card(
        title=cluster.name,
        lines=[
            f"{_counted(cluster.failures, 'failure')}, {cluster.distinct} distinct, {cluster.preventable} preventable",
            f"grade: {f'{cluster.grade}: {prevented}' if prevented else 'not judged'}",
            *(_fault(pictured) if pictured else ()),
            *_told(run, record),
        ],
        command=origin.show(run, cluster.representative),
        drawing=draw(run, origin.folders.get(run.spec.digest), record.index),
    )


def _fault(violation: Collision | Violation) -> Iterator[str]:
    """Describes the party at fault and the ego's reaction to the striker."""
    if violation.blamed is not None:
        judged = violation.judgement if isinstance(violation, Collision) else None
        did = f"; the ego {ego_did(judged.ego_part)}" if judged and judged.ego_part else ""
        yield f"fault: {violation.blamed}{did}"


def _told(run: FinishedRun, record: EpisodeRecord) -> Iterator[str]:
    """Of the pictured failure."""
    yield f"pictured: {record.id_in(run.spec.id)}{f', driven by {record.driven_by}' if record.driven_by else ''}"
    if record.collision is not None:
        yield _contact(record.collision)
    yield from map(_violation, record.violations)
    repeated = run.verified.episodes.get(record.index) if run.verified else None
    if repeated is not None:
        yield f"replayed {repeated.times} times, {repeated.same} times the same to the bit"
    study = run.studies.get(record.index)
    if study is not None and study.core is not None:
        yield f"core: {study.core.sentence}"
    if study is not None and study.region is not None:
        shares = ", ".join(f"{share.what} {share.failed} of {share.played}" for share in study.region.shares)
        yield f"neighbours that fail too: {shares}"


def _contact(hit: Collision) -> str:
    conflict = f"; {began(hit, hit.judgement)}" if hit.judgement else ""
    bad = f"; {hit.severity_in_words}" if hit.severity_in_words else ""
    return f"touches {hit.other_id}, {known(hit)}{conflict}; ego's speed {hit.ego_speed_mps:.1f} m/s{bad}"


def _violation(violation: Violation) -> str:
    return (
        f"violates {violation.requirement} from {violation.time_s:.1f} s after the release, at "
        f"{violation.ego_speed_mps:.1f} m/s; least robustness {violation.robustness:.2f}"
    )


def regression(origin: Origin) -> Section:
    """Writes the section on the failures with another ego."""
    found = origin.regression
    if found is None:
        none = "No other ego was played against these failures. To do so, and to be told here:"
        return Section("regression", "Regression", [none, Commands([origin.regress])])
    said = found.counts_in_words or "no failure"
    known = sum(case.known for case in found.cases)
    text = (
        f"The failures against another ego: {ego_in_words(found.ego)}. Of {len(found.cases)}: {said}; "
        f"{known} known from a baseline. {'All are fixed or known.' if found.passed else 'Not all are fixed or known.'}"
    )
    columns = ["failure", "kind", "grade", "verdict", "what happens now"]
    rows = [[case.id, case.name, case.grade or DASH, case.verdict_in_words, case.reason] for case in found.cases]
    table = Table("regression", columns, rows, left=5)
    return Section("regression", "Regression", [text, table, Commands([origin.regress])])


def worth(power: Power, found: bool) -> Section:
    """Writes the section on known defects that the budget detects; `found`: a failure."""
    title = "Known defects that this budget detects" if found else "What finding nothing is worth"
    text = "Had the ego a fault that we know, would this budget have found it? Nothing was run for the answer. "
    return Section("worth", title, [text + power.note, Items(power.lines)])


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
