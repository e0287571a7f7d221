"""Writes a report's sections on the ODD: content, failure rates, coverage."""

from collections.abc import Iterator, Mapping

from risk_sac.config import IID_METHODS, FamilyName
from risk_sac.errors import ConfigError
from risk_sac.report.comparison import Comparison
from risk_sac.report.evidence.coverage import BINS, PAIR_BINS, Coverage, ParameterCoverage
from risk_sac.report.evidence.document import Block, Commands, Items, Section, Table
from risk_sac.report.evidence.gathered import Bound, Drawn, Evidence, FamilyCoverage
from risk_sac.report.evidence.origin import again
from risk_sac.report.evidence.words import odd_in_words
from risk_sac.report.page import DASH, percent
from risk_sac.scenario.families import family_named
from risk_sac.scenario.family import Family

MOST_PAIRS, MOST_CELLS = 12, 8  # that are named; all are in the data
TRAFFIC: Mapping[str, str] = {"iid-undisturbed": "undisturbed", "iid-random": "random adversaries"}
NO_IID = (
    "The campaign had no i.i.d. phase, so nothing can be said of how often the ego fails: a search chooses scenes to "
    "make it fail. A campaign ends with one where its spec has, or its command line:"
)


def odd(comparison: Comparison) -> Section:
    """The ODD of each family, in words."""
    there: dict[FamilyName, Family] = {}
    lost = []
    for name in comparison.spec.families:
        try:
            there[name] = family_named(name)
        except ConfigError as error:
            lost.append(f"{name}: {error}")
    told = [dict(odd_in_words(family, comparison.spec.odd)) for family in there.values()]
    rows = [[words, *(each[words] for each in told)] for words in told[0]] if told else []
    blocks: list[Block] = [
        Items([*(f"{name}: {family.summary}" for name, family in there.items()), *lost]),
        Table("ODD", ["of the ODD", *there], rows, left=1 + len(there)),
    ]
    return Section("odd", "Operational design domain", blocks)


def bounds(comparison: Comparison, evidence: Evidence) -> Section:
    """Writes the section on failure rates in scenes that no search chose."""
    title = "How often it fails in unsearched scenes"
    if comparison.spec.iid is None:
        return Section("bounds", title, [NO_IID, Commands(["iid: {episodes: 300}", "--iid 300"])])
    blocks: list[Block] = [
        (
            "These scenes were drawn from the ODD independently of each other and of any search, uniformly between the "
            "bounds of each scene parameter, with a seed of their own. Bounds are Clopper and Pearson's, exact and "
            "one-sided: the rate is at most the upper one with 95 % confidence, and at least the lower one with 95 %, "
            "each row by itself. They hold for such scenes, in this simulator, with this traffic: no road has them in "
            "these shares."
        ),
        Items([f"{words}: {IID_METHODS[name].summary}" for name, words in TRAFFIC.items() if name in IID_METHODS]),
    ]
    if evidence.bounds:
        columns = ["family", "traffic", "what", "of played", "at most", "at least", "scenes", "refused"]
        rows = [row for each in evidence.bounds for row in _rows(each)]
        blocks.append(Table("bounds", columns, rows, left=3))
        if requirements := [row for each in evidence.bounds for row in _requirements(each)]:
            columns = ["family", "traffic", "requirement", "counts", "violated", "bounded", "at most", "at least"]
            blocks += [
                "By requirement. Bounds are of valid violations where the requirement counts as a failure, and of all "
                "violations where it is reported only:",
                Table("bounds by requirement", columns, requirements, left=4),
            ]
    if unended := sum(each.unended for each in evidence.bounds):
        why = f"In {unended} scenes the simulator died, or the ego failed to drive"
        blocks.append(f"{why}: upper bounds count them as failures.")
    if comparison.undrawn:
        lacking = [f"{run.spec.id}: {run.reason}" for run in comparison.undrawn]
        blocks += ["Missing, and so without bounds:", Items(lacking)]
    if comparison.drawn:
        first = comparison.drawn[0]
        blocks += ["One of these runs again, to the digit:", Commands([again(comparison, first)])]
    return Section("bounds", title, blocks)


def _rows(each: Drawn) -> Iterator[list[str]]:
    told: Mapping[str, Bound] = {
        "contacts": each.contacts,
        "failures": each.failures,
        "preventable failures": each.preventable,
    }
    for what, bound in told.items():
        yield [
            each.family,
            TRAFFIC[each.method],
            what,
            f"{bound.count} of {each.played}",
            percent(bound.high, 2),
            percent(bound.low, 2),
            str(each.scenes),
            str(each.refused),
        ]


def _requirements(each: Drawn) -> Iterator[list[str]]:
    for name, found in each.requirements.items():
        yield [
            each.family,
            TRAFFIC[each.method],
            name,
            found.counts,
            f"{found.violated} of {each.played}",
            f"{found.bound.count} of {each.played}",
            percent(found.bound.high, 2),
            percent(found.bound.low, 2),
        ]


def coverage(evidence: Evidence) -> Section:
    """Writes the section on the covered and the uncovered parts of the ODD."""
    text = (
        f"The range of each scene parameter within the ODD is parted into {BINS} bins of equal width, and that of each "
        f"pair into {PAIR_BINS} × {PAIR_BINS} cells. A bin says how many episodes began in it, and how many of them "
        "failed, by any requirement that counts; a scene that was refused is none. What unfolds after the beginning is "
        "in the taxonomy, for contacts."
    )
    parts = [_of_family(family, found) for family, found in evidence.coverage.items()]
    return Section("coverage", "Coverage", [text], parts)


def _of_family(family: FamilyName, found: FamilyCoverage) -> Section:
    searched = found.search
    blocks: list[Block] = [
        *_parameters(searched, "search"),
        *(_parameters(found.iid, "i.i.d. phase") if found.iid else []),
        "Never sampled, by the search or the i.i.d. phase:",
        Items(list(_never(found)) or ["Every bin of every parameter, and every cell of every pair, has an episode."]),
        *_taxonomy(searched),
    ]
    return Section(f"coverage-{family}", family, blocks)


def _parameters(coverage: Coverage, phase: str) -> Iterator[Block]:
    numbers = [each for each in coverage.parameters if not each.categorical]
    sorts = [each for each in coverage.parameters if each.categorical]
    yield f"By the {phase}: {coverage.episodes} episodes, as failed / played in each tenth of the range."
    heads = ["parameter", "from", "to", *(str(number + 1) for number in range(BINS))]
    rows = [
        [
            _named(each),
            f"{each.low:.4g}",
            f"{each.high:.4g}",
            *(f"{bin_.failed} / {bin_.played}" for bin_ in each.bins),
            *[DASH] * (BINS - len(each.bins)),
        ]
        for each in numbers
    ]
    yield Table(f"bins, {phase}", heads, rows)
    if sorts:
        kinds = [[each.name, bin_.name, f"{bin_.failed} / {bin_.played}"] for each in sorts for bin_ in each.bins]
        yield Table(f"categories, {phase}", ["parameter", "category", "failed / played"], kinds, left=2)
    failed = sum(each.failed for each in coverage.pairs)
    played = sum(each.played for each in coverage.pairs)
    cells = sum(each.cells for each in coverage.pairs)
    yield (
        f"Pairs of parameters: {len(coverage.pairs)} with {cells:,} cells, of which {played:,} have an episode and "
        f"{failed:,} a failure."
    )


def _named(each: ParameterCoverage) -> str:
    return each.name if each.unit == "1" else f"{each.name} ({each.unit})"


def _never(found: FamilyCoverage) -> Iterator[str]:
    """Lists in words the parts that neither phase has covered."""
    both = [each for each in (found.search, found.iid) if each is not None]
    for several in zip(*(each.parameters for each in both), strict=True):
        bins = [name for name in several[0].never if all(name in each.never for each in several)]
        if bins:
            yield f"{_named(several[0])}: {', '.join(bins)}"
    lacking = []
    for pairs in zip(*(each.pairs for each in both), strict=True):
        cells = [cell for cell in pairs[0].never if all(cell in each.never for each in pairs)]
        if cells:
            lacking.append((pairs[0].parameters, cells))
    lacking.sort(key=lambda each: -len(each[1]))
    for (first, second), cells in lacking[:MOST_PAIRS]:
        more = f", and {len(cells) - MOST_CELLS} more" if len(cells) > MOST_CELLS else ""
        yield f"{first} with {second}: {', '.join(cells[:MOST_CELLS])}{more}"
    if len(lacking) > MOST_PAIRS:
        yield f"cells of {len(lacking) - MOST_PAIRS} more pairs"
    if found.search.beyond:
        yield f"what the ODD allows and no scene begins with: {', '.join(found.search.beyond)}"
    yield f"no scene parameter varies {', '.join(found.search.fixed)}"


def _taxonomy(coverage: Coverage) -> Iterator[Block]:
    found = coverage.kinds
    yield (
        f"Taxonomy of contacts: {len(found.hit)} of {found.cells:,} cells hold a valid contact of the search. Most of "
        "the others hold what no ego and no road allows."
    )
    if found.hit:
        yield Table("taxonomy", ["cell", "contacts"], [[name, str(count)] for name, count in found.hit.items()])
    yield f"In no contact: {', '.join(found.never) or 'nothing; each value was met'}."
