"""The comparison as a page to read, from `table.md.jinja`; here are the rows of its tables."""

import re
import shlex
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from statistics import median

from jinja2 import Environment, StrictUndefined, Template

from risk_sac.config import FamilyName, RunSpec
from risk_sac.failures.clusters import Overview
from risk_sac.metrics import COLUMNS, METRICS, RATIOS, Estimate, Metric, Ratio, requirement_cells
from risk_sac.records import Phase
from risk_sac.report.cells import Cell, metrics_of
from risk_sac.report.comparison import DECLARED, REFERENCE, RIVALS, Comparison, declared
from risk_sac.report.page import DASH, interval, number, percent, platform_in_words, table, versions_in_words
from risk_sac.report.paired import LEVEL, PairedTest, power_of
from risk_sac.report.runs import LIMITS, TESTED, FinishedRun, found_within
from risk_sac.report.verdicts import RowsOf, class_rows, driven_by_rows, driver_rows

CONTROL = "no-adversary"
MOST_CLUSTERS = 12  # rows of their table
SHARES = ("artefact_rate", "degenerate_rate", "rejected_rate")  # the last columns of the table of methods
# RISK-SAC's row of the paper's Table I, by family.
PAPER: dict[str, dict[FamilyName, float]] = {
    "ecr": {"low": 0.97, "mixed": 0.92, "dense": 0.89},
    "es": {"low": 0.94, "mixed": 0.88, "dense": 0.84},
    "rho_c": {"low": 0.15, "mixed": 0.25, "dense": 0.30},  # at most
    "ofd": {"low": 0.82, "mixed": 0.85, "dense": 0.92},
}
ROWS: Mapping[str, Metric | Ratio] = {row.name: row for row in (*METRICS, *RATIOS)}


def symbol(name: str) -> str:
    """A figure's in a table's head."""
    return ROWS[name].symbol


def table_markdown(comparison: Comparison) -> str:
    """`table.md`."""
    tables = Tables(comparison)
    text = _template().render(
        **{name: getattr(tables, name) for name in dir(tables) if not name.startswith("_")},
        comparison=comparison,
        spec=comparison.spec,
        versions=versions_in_words(comparison.versions) or DASH,
        platform=platform_in_words(),
    )
    return re.sub("\n{3,}", "\n\n", text)


@cache
def _template() -> Template:
    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )  # the page is Markdown: nothing is escaped but cells of tables
    environment.filters |= {"number": number, "symbol": symbol}
    environment.filters["defined"] = lambda name: f"{symbol(name)}: {ROWS[name].meaning}."
    environment.tests["declared"] = declared
    environment.globals |= {
        "class_rows": class_rows,
        "declared_metrics": DECLARED,
        "driven_by_rows": driven_by_rows,
        "driver_rows": driver_rows,
        "level": f"{LEVEL:g}",
        "metrics": METRICS,
        "most_clusters": MOST_CLUSTERS,
        "power_of": power_of,
        "reference": REFERENCE,
        "rivals": RIVALS,
        "run_command": run_command,
        "test_table": test_table,
        "tested_limit": TESTED,
    }
    return environment.from_string((files(__package__) / "table.md.jinja").read_text(encoding="utf-8"))


def _filled(columns: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    """A table; nothing without rows."""
    found = list(rows)
    return table(columns, found, left) if found else ""


class Tables:
    """The tables of a comparison, as the template names them."""

    def __init__(self, comparison: Comparison) -> None:
        self._comparison = comparison

    def missing(self) -> str:
        """Runs that the other tables lack."""
        rows = ([run.spec.family, run.spec.method, str(run.spec.seed), run.reason] for run in self._comparison.missing)
        return _filled(["family", "method", "seed", "why"], rows, left=4)

    def cells(self, family: FamilyName, phase: Phase) -> str:
        """The metrics of every method."""
        columns = ["method", "seeds", *(metric.symbol for metric in metrics_of(phase) if metric.tabled)]
        columns += [symbol("steps_per_distinct_failure"), *(["CPU s / distinct"] if phase == "search" else [])]
        columns += map(symbol, SHARES)
        seeds = len(self._comparison.spec.seeds)
        return _filled(columns, (_cell(cell, seeds) for cell in self._comparison.group(family, phase)))

    def funnel(self, family: FamilyName, phase: Phase) -> str:
        """Contacts, and failures of any requirement down to what is worth a person's time, summed over seeds."""
        columns = ["method", "headline", "episodes", "contacts", "valid contacts"]
        columns += ["failures", "distinct", "preventable", "not minor", "verified"]
        columns.append(symbol("unresponsive_share"))
        rows = (
            [
                cell.method,
                number(cell.headline, "d"),
                *map(str, (cell.episodes, cell.raw_collisions, cell.collisions)),
                *map(str, (cell.failures, cell.distinct_failures, cell.distinct_preventable)),
                str(cell.headline_candidates),
                verified(self._comparison.of_cell(family, cell.method), phase),
                DASH if cell.unresponsive_share is None else percent(cell.unresponsive_share),
            ]
            for cell in self._comparison.group(family, phase)
        )
        return _filled(columns, rows)

    def by_method(self, rows_of: RowsOf, family: FamilyName, phase: Phase) -> str:
        """A row for each method."""
        cells = self._comparison.group(family, phase)
        columns, rows = rows_of(cells)
        return _filled(["method", *columns], ([cell.method, *row] for cell, row in zip(cells, rows, strict=False)))

    def requirements(self, family: FamilyName, phase: Phase) -> str:
        """The funnel of each requirement, summed over seeds."""
        rows = (
            [cell.method, *requirement_cells(name, found)]
            for cell in self._comparison.group(family, phase)
            for name, found in cell.requirements.items()
        )
        return _filled(["method", *COLUMNS], rows, left=3)

    def budgets(self, family: FamilyName) -> str:
        """Tabulates findings within each limit: median over seeds, least and most."""
        rows = []
        for method in self._comparison.methods:
            runs = self._comparison.of_cell(family, method)
            for limit in LIMITS:
                found = [each for each in (found_within(run, limit) for run in runs) if each is not None]
                if found:
                    rows.append([method, limit.name, str(len(found)), *map(_spread, zip(*found, strict=True))])
        return _filled(
            ["method", "within", "runs", "headline", "preventable", "distinct", symbol("covered")], rows, left=2
        )

    def times(self, family: FamilyName, phase: Phase) -> str:
        """Tabulates the times from the release to conflicts and contacts."""
        bins = {
            (cell.method, until): counts
            for cell in self._comparison.group(family, phase)
            if any(cell.contacts_by_second)
            for until, counts in (("conflict", cell.conflicts_by_second), ("contact", cell.contacts_by_second))
        }
        seconds = max((place + 1 for counts in bins.values() for place, count in enumerate(counts) if count), default=0)
        columns = ["method", "until", *(f"{second}–{second + 1} s" for second in range(seconds))]
        return _filled(columns, ([*name, *map(str, counts[:seconds])] for name, counts in bins.items()), left=2)

    def signatures(self, family: FamilyName, phase: Phase) -> str:
        """Tabulates the counts of each class of failures, the most frequent first."""
        cells = [cell for cell in self._comparison.group(family, phase) if cell.signatures]
        total = sum((Counter(cell.signatures) for cell in cells), Counter[str]())
        rows = ([name, *(str(cell.signatures.get(name, 0)) for cell in cells)] for name, _ in total.most_common())
        return _filled(["signature", *(cell.method for cell in cells)], rows)

    def clusters(self, found: Overview, most: int) -> str:
        """The kinds of failures that all methods have found together, and one of each to look at."""
        rows = (
            [each.name, str(each.failures), str(each.distinct), str(each.preventable), f"`{each.representative}`"]
            for each in found.clusters[:most]
        )
        return _filled(["kind", "failures", "distinct", "preventable", "look first at"], rows)

    def cores(self, family: FamilyName) -> str:
        """The cores of failures that were asked for."""
        columns = [
            "failure",
            "what happens",
            "adversaries that act",
            "segments of 0.5 s",
            "copies of the core that fail",
        ]
        rows = (
            [
                f"`{id_}`",
                core.sentence,
                f"{core.before.adversaries} → {core.after.adversaries}",
                f"{core.before.segments} → {core.after.segments}",
                f"{core.held} of {core.copies}",
            ]
            for id_, core in ((id_, each.core) for id_, each in self._comparison.studies(family).items())
            if core
        )
        return _filled(columns, rows, left=2)

    def regions(self, family: FamilyName) -> str:
        """Tabulates the failing neighbours of failures, where that was requested."""
        found = {id_: each.region for id_, each in self._comparison.studies(family).items() if each.region}
        columns = [
            "failure",
            *(share.what for region in list(found.values())[:1] for share in region.shares),
            "a needle",
        ]
        rows = (
            [
                f"`{id_}`",
                *(f"{each.failed} of {each.played}{interval(each.low, each.high, '.2f')}" for each in region.shares),
                "yes" if region.needle else "no",
            ]
            for id_, region in found.items()
        )
        return _filled(columns, rows)

    def controls(self) -> str:
        """Tabulates the rate of contacts that the simulator makes by itself."""
        rows = (
            [cell.family, cell.phase, str(cell.episodes), percent(cell.raw_rate)]
            for cell in self._comparison.cells
            if cell.method == CONTROL
        )
        return _filled(["family", "phase", "episodes", symbol("raw_rate")], rows, left=2)

    def paper(self) -> str:
        """The paper's Table I beside ours, for the method that is in both."""
        columns = ["family", "phase"]
        for heading in map(symbol, PAPER):
            columns += [heading, f"{heading} paper"]
        rows: list[list[str]] = []
        for cell in (cell for cell in self._comparison.cells if cell.method == REFERENCE):
            rows.append([cell.family, cell.phase])
            for name, paper in PAPER.items():
                theirs = f"{'≤ ' if name == 'rho_c' else ''}{paper[cell.family]:.2f}"
                rows[-1] += [number(cell.estimates[name].mean, ".2f"), theirs]
        return _filled(columns, rows, left=2)


def _cell(cell: Cell, seeds: int) -> list[str]:
    runs = len(cell.seeds)
    row = [cell.method, str(runs) if runs == seeds else f"{runs} of {seeds}"]
    row += [_estimate(cell.estimates[metric.name], runs) for metric in metrics_of(cell.phase) if metric.tabled]
    row.append(number(cell.steps_per_distinct_failure, ",.0f"))
    if cell.phase == "search":
        row.append(number(cell.cpu_s_per_distinct_failure, ",.1f"))
    return row + [percent(getattr(cell, name)) for name in SHARES]


def _estimate(estimate: Estimate, runs: int) -> str:
    if estimate.mean is None:
        return DASH
    text = f"{estimate.mean:.3f}" + interval(estimate.low, estimate.high)
    return text if estimate.runs == runs else f"{text} ({estimate.runs} of {runs} seeds)"


def _spread(values: Sequence[int]) -> str:
    return f"{median(values):g} ({min(values)}–{max(values)})"


def verified(runs: Sequence[FinishedRun], phase: Phase) -> str:
    """Counts the replayed distinct failures that were the same each time."""
    if not all(run.verified for run in runs):
        return DASH
    repetitions = [
        run.verified.episodes[record.index]
        for run in runs
        if run.verified
        for record in run.phase(phase)
        if record.index in run.verified.episodes
    ]
    return f"{sum(repetition.verified for repetition in repetitions)} of {len(repetitions)}"


def test_table(tests: Sequence[PairedTest]) -> str:
    """Tests of the reference against others; what is significant is bold."""
    columns = ["metric", "against", "pairs", "difference (95 %)", "A12", "p", "p (Holm)"]
    return table(columns, map(_test, tests), left=2)


def _test(test: PairedTest) -> list[str]:
    p_holm = number(test.p_holm, ".3g")
    return [
        symbol(test.metric) if test.metric in ROWS else test.metric,
        test.method,
        str(test.pairs),
        number(test.difference, "+.3f") + interval(test.low, test.high, "+.3f"),
        number(test.a12, ".2f"),
        number(test.p, ".3g"),
        f"**{p_holm}**" if test.significant else p_holm,
    ]


def run_command(spec: RunSpec, spec_file: str, out: str) -> str:
    """The command of a single run of a campaign whose spec lies in a file."""
    picked = ["--family", spec.family, "--method", spec.method, "--seed", str(spec.seed)]
    return shlex.join(["risk-sac", "run", "--spec", spec_file, *picked, "--out", out])
