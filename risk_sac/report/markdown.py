"""The comparison as a page to read: tables, tests, and everything needed to judge and repeat them."""

import shlex
from collections.abc import Iterator, Sequence
from statistics import median

from risk_sac.config import Budget, FamilyName, RunSpec
from risk_sac.metrics import Estimate
from risk_sac.records import Phase
from risk_sac.report.cells import Cell, metrics_of
from risk_sac.report.comparison import Comparison, declared
from risk_sac.report.definitions import ROWS, definitions, symbol
from risk_sac.report.kinds import clusters, signatures, studies
from risk_sac.report.page import DASH, interval, number, percent, platform_in_words, table, versions_in_words
from risk_sac.report.paired import LEVEL, PairedTest, pairs_needed, smallest_p
from risk_sac.report.runs import HEADLINE, LIMITS, FinishedRun, found_within

CONTROL = "no-adversary"
SHARES = ("artefact_rate", "degenerate_rate", "rejected_rate")  # the last columns of the table of methods
# RISK-SAC's row of the paper's Table I, by family.
PAPER: dict[str, dict[FamilyName, float]] = {
    "ecr": {"low": 0.97, "mixed": 0.92, "dense": 0.89},
    "es": {"low": 0.94, "mixed": 0.88, "dense": 0.84},
    "rho_c": {"low": 0.15, "mixed": 0.25, "dense": 0.30},  # at most
    "ofd": {"low": 0.82, "mixed": 0.85, "dense": 0.92},
}


def table_markdown(comparison: Comparison) -> str:
    """`table.md`."""
    sections = [_head(comparison), _missing(comparison)]
    for family in comparison.spec.families:
        for phase in comparison.phases:
            sections += [
                _cells(comparison, family, phase),
                _funnel(comparison, family, phase),
                _budgets(comparison, family) if phase == "search" else "",
                _times(comparison, family, phase),
                signatures(comparison, family, phase),
                _tests(comparison, family, phase),
            ]
        sections.append(clusters(comparison, family))
        sections.append(studies(comparison, family))
    sections += [_control(comparison), _paper(comparison), definitions(), _repeat(comparison)]
    return "\n".join(section for section in sections if section)


def _head(comparison: Comparison) -> str:
    spec = comparison.spec
    facts = {
        "campaign": f"`{spec.digest}`",
        "runs": f"{len(comparison.runs)} of {len(comparison.runs) + len(comparison.missing)}: "
        f"families {', '.join(spec.families)} × {len(spec.methods)} methods × seeds {', '.join(map(str, spec.seeds))}",
        "budget of a run": f"{spec.budget.episodes} search episodes{_cut_short(spec.budget)}, "
        f"{spec.budget.evaluation_episodes} evaluation episodes with the policy frozen",
        "versions": versions_in_words(comparison.versions) or DASH,
        "platform": platform_in_words(),
    }
    lines = (f"- {name}: {value}" for name, value in facts.items())
    return f"# Comparison of methods\n\n```\n{comparison.command}\n```\n\n" + "\n".join(lines) + "\n"


def _cut_short(budget: Budget) -> str:
    """What ends a search before it has played them all."""
    if budget.cpu_s is None:
        return ""
    return f", or as many as {budget.cpu_s:g} s of processor time last for, but at least {budget.least_episodes}"


def _missing(comparison: Comparison) -> str:
    if not comparison.missing:
        return ""
    rows = ([run.spec.family, run.spec.method, str(run.spec.seed), run.reason] for run in comparison.missing)
    title = f"## Missing: {len(comparison.missing)} runs\n\nThe tables hold only what has finished.\n\n"
    return title + table(["family", "method", "seed", "why"], rows, left=4)


def _cells(comparison: Comparison, family: FamilyName, phase: Phase) -> str:
    seeds = len(comparison.spec.seeds)
    columns = ["method", "seeds", *(metric.symbol for metric in metrics_of(phase) if metric.tabled)]
    columns += [symbol("steps_per_distinct_failure"), *(["CPU s / distinct"] if phase == "search" else [])]
    columns += map(symbol, SHARES)
    rows = [_cell(cell, seeds) for cell in comparison.group(family, phase)]
    return f"## {family}, {phase}\n\n" + table(columns, rows) if rows else ""


def _cell(cell: Cell, seeds: int) -> list[str]:
    runs = len(cell.seeds)
    row = [cell.method, str(runs) if runs == seeds else f"{runs} of {seeds}"]
    row += [_estimate(cell.estimates[metric.name], runs) for metric in metrics_of(cell.phase) if metric.tabled]
    row.append(number(cell.steps_per_distinct_failure, ",.0f"))
    if cell.phase == "search":
        row.append(number(cell.cpu_s_per_distinct_failure, ",.1f"))
    return row + [percent(getattr(cell, name)) for name in SHARES]


def _funnel(comparison: Comparison, family: FamilyName, phase: Phase) -> str:
    """From contacts to what is worth a person's time, summed over seeds."""
    columns = ["method", "episodes", "contacts", "valid", "distinct", "preventable", "verified"]
    columns.append(symbol("unresponsive_share"))
    rows = (
        [
            cell.method,
            *map(str, (cell.episodes, cell.raw_collisions, cell.failures)),
            *map(str, (cell.distinct_failures, cell.distinct_preventable)),
            verified(comparison.of_cell(family, cell.method), phase),
            DASH if cell.unresponsive_share is None else percent(cell.unresponsive_share),
        ]
        for cell in comparison.group(family, phase)
    )
    return f"### The funnel: {family}, {phase}\n\n" + table(columns, rows)


def verified(runs: Sequence[FinishedRun], phase: Phase) -> str:
    """How many of the distinct failures that were replayed were the same each time."""
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


def _budgets(comparison: Comparison, family: FamilyName) -> str:
    """What a user gets for processor time and for episodes: median over seeds, and the least and the most."""
    rows = []
    for method in comparison.methods:
        runs = comparison.of_cell(family, method)
        for limit in LIMITS:
            found = [each for each in (found_within(run, limit) for run in runs) if each is not None]
            if found:
                rows.append([method, limit.name, str(len(found)), *map(_spread, zip(*found, strict=True))])
    if not rows:
        return ""
    columns = ["method", "within", "runs", "preventable", "distinct", symbol("covered")]
    page = f"### What a budget finds: {family}\n\n" + table(columns, rows, left=2)
    tests = [test for test in comparison.headline if test.family == family]
    if not tests:
        return page
    title = f"Distinct preventable failures within {HEADLINE.name}, {tests[0].reference} against the others:\n\n"
    return f"{page}\n{title}" + _tested(tests)


def _spread(values: Sequence[int]) -> str:
    return f"{median(values):g} ({min(values)}–{max(values)})"


def _times(comparison: Comparison, family: FamilyName, phase: Phase) -> str:
    """How long after the release conflicts and contacts come."""
    cells = [cell for cell in comparison.group(family, phase) if any(cell.contacts_by_second)]
    if not cells:
        return ""
    last = max(place for cell in cells for bins in _both(cell) for place, count in enumerate(bins) if count)
    columns = ["method", "until", *(f"{second}–{second + 1} s" for second in range(last + 1))]
    rows = (
        [cell.method, until, *map(str, bins[: last + 1])]
        for cell in cells
        for until, bins in zip(("conflict", "contact"), _both(cell), strict=True)
    )
    return f"### Valid failures by the time since the release: {family}, {phase}\n\n" + table(columns, rows, left=2)


def _both(cell: Cell) -> tuple[tuple[int, ...], tuple[int, ...]]:
    return cell.conflicts_by_second, cell.contacts_by_second


def _estimate(estimate: Estimate, runs: int) -> str:
    if estimate.mean is None:
        return DASH
    text = f"{estimate.mean:.3f}" + interval(estimate.low, estimate.high)
    return text if estimate.runs == runs else f"{text} ({estimate.runs} of {runs} seeds)"


def _tests(comparison: Comparison, family: FamilyName, phase: Phase) -> str:
    tests = [test for test in comparison.tests if (test.family, test.phase) == (family, phase)]
    if not tests:
        return ""
    title = f"### {comparison.reference} against the others: {family}, {phase}\n\n"
    parts = [test for test in tests if declared(test)], [test for test in tests if not declared(test)]
    if not all(parts):
        return title + _tested(tests)
    return f"{title}Declared before any run:\n\n{_tested(parts[0])}The rest:\n\n{_tested(parts[1])}"


def _tested(tests: Sequence[PairedTest]) -> str:
    columns = ["metric", "against", "pairs", "difference (95 %)", "A12", "p", "p (Holm)"]
    return table(columns, map(_test, tests), left=2) + "\n" + "".join(_power(tests)) + "\n"


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


def _power(tests: Sequence[PairedTest]) -> Iterator[str]:
    """What the number of pairs lets the tests say."""
    hypotheses = sum(test.p is not None for test in tests)
    if not hypotheses:
        yield "No pair of methods has two seeds in common, so nothing is tested."
        return
    pairs = max(test.pairs for test in tests)
    least = smallest_p(pairs)
    yield f"The smallest p that {pairs} pairs can give is {least:.4g}; corrected over {hypotheses} tests it is at best "
    yield f"{min(1.0, hypotheses * least):.3g}. "
    if hypotheses * least > LEVEL:
        needed = pairs_needed(hypotheses, LEVEL)
        yield f"So no corrected test can fall below {LEVEL:g} here, whatever the methods do: "
        yield f"that takes {needed} seeds. "
        yield "Read the intervals and A12 instead."


def _control(comparison: Comparison) -> str:
    """How often the simulator makes a contact by itself."""
    cells = [cell for cell in comparison.cells if cell.method == CONTROL]
    if not cells:
        return ""
    rows = ([cell.family, cell.phase, str(cell.episodes), percent(cell.raw_rate)] for cell in cells)
    title = "## The simulator's own artefacts\n\nContacts of any kind with `no-adversary`, where nobody attacks.\n\n"
    return title + table(["family", "phase", "episodes", symbol("raw_rate")], rows, left=2)


def _paper(comparison: Comparison) -> str:
    """The paper's Table I beside ours, for the method that is in both."""
    ours = [cell for cell in comparison.cells if cell.method == "risk-sac"]
    if not ours:
        return ""
    rows: list[list[str]] = []
    for cell in ours:
        rows.append([cell.family, cell.phase])
        for name, paper in PAPER.items():
            mean = cell.estimates[name].mean
            rows[-1] += [number(mean, ".2f"), f"{'≤ ' if name == 'rho_c' else ''}{paper[cell.family]:.2f}"]
    columns = ["family", "phase"]
    for heading in map(symbol, PAPER):
        columns += [heading, f"{heading} paper"]
    title = (
        "## Beside the paper\n\nThe paper's RISK-SAC was measured in CARLA, against another ego and with other "
        "definitions of a failure, of realism and of outcome features; the numbers are no target.\n\n"
    )
    return title + table(columns, rows, left=2)


def _repeat(comparison: Comparison) -> str:
    """The commands that give one row's digest again."""
    if not comparison.runs:
        return ""
    run = comparison.runs[0]
    again = run_command(run.spec, comparison.spec_file, "repeated")
    commands = [comparison.spec_command, again] if comparison.spec_command else [again]
    return (
        "## Repeat one run\n\n"
        "```\n" + "\n".join(commands) + "\n```\n\n"
        f"gives a `results.json` with the digest `{run.digest}`; `table.json` has the digest of every run. The same "
        "digest needs the same versions and the same kind of processor or GPU.\n"
    )


def run_command(spec: RunSpec, spec_file: str, out: str) -> str:
    """The command of a single run of a campaign whose spec lies in a file."""
    picked = ["--family", spec.family, "--method", spec.method, "--seed", str(spec.seed)]
    return shlex.join(["risk-sac", "run", "--spec", spec_file, *picked, "--out", out])
