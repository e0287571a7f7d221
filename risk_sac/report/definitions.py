"""What the words and figures of the page mean."""

from risk_sac.metrics import METRICS, RATIOS, Metric, Ratio
from risk_sac.report.comparison import DECLARED, REFERENCE, RIVALS
from risk_sac.report.paired import LEVEL

ROWS: dict[str, Metric | Ratio] = {row.name: row for row in (*METRICS, *RATIOS)}


def definitions() -> str:
    """The section of the page."""
    lines = [f"- {defined(metric.name)}" for metric in METRICS]
    lines += [
        "- search: the training episodes, rejected scenes included; evaluation: the frozen policy acting by its mean.",
        "- mean over seeds and, in brackets, its 95 % interval: percentile bootstrap over seeds, which with fewer than "
        "about ten seeds is narrower than its name; Wilson's for the rates of a single run.",
        "- n of m seeds: the mean is over the n runs that have a value; OFD needs two valid failures.",
        "- distinct: valid failures that resemble no earlier one of the same run: another signature, or the same one "
        "with other outcome features; summed over seeds.",
        f"- {defined('steps_per_distinct_failure')}",
        "- CPU s / distinct: the same with the processor seconds of the whole runs, evaluation episodes included; a "
        "process's start and what a crashed attempt spent are not.",
        f"- {defined('artefact_rate')}",
        "- contacts, valid, distinct, preventable: what the ego touched; without artefacts and degenerate contacts; "
        "each kind once; of these, what the careful driver would have prevented (PCR counts repetitions too). What was "
        "found before contacts were judged counts as not preventable, and is in no histogram and no signature.",
        "- verified: of the first failures of each kind, and the first preventable ones, those that were the same to "
        "the bit each time that they were replayed in a fresh process; one that was not, and what is like it, counts "
        "as no failure.",
        "- what a budget finds: distinct preventable failures, distinct valid ones and kinds in the episodes that "
        "ended within it; median over the runs that spent it, least and most. Processor time is that of one process, "
        "its start apart.",
        "- careful driver: UN Regulation 157's careful and competent human driver, for pedestrians and crossing "
        "vehicles after Engström et al. (arXiv 2208.08651), in the ego's place; the striker's motion is kept.",
        f"- {defined('unresponsive_share')}",
        "- time since the release: from when the adversaries are handed to the policy to the beginning of the "
        "conflict, and to the contact; what began before the release stands in the first second.",
        f"- {defined('degenerate_rate')} {defined('rejected_rate')}",
        "- difference: mean over the seeds that both methods have a value for, first method minus the other, with a "
        "paired bootstrap 95 % interval.",
        "- A12 (Vargha-Delaney): chance that a run of the first method has the larger value; 0.5 is no difference.",
        "- p: Wilcoxon signed-rank, two-sided, exact also with ties; zero differences are left out.",
        "- p (Holm): corrected over the hypotheses of one family and phase that were declared before any run, apart "
        f"for {' and '.join(symbol(name) for name in DECLARED)} of {REFERENCE} against {' and '.join(RIVALS)} and for "
        "distinct preventable failures within a budget, and over all the other methods and metrics together; bold "
        f"below {LEVEL:g}.",
        f"- {symbol('distinct_per_1000_steps')} is tested in place of its reciprocal, "
        f"{symbol('steps_per_distinct_failure')}, because a run without a failure has it too.",
    ]
    return "## Definitions\n\n" + "\n".join(lines) + "\n"


def symbol(name: str) -> str:
    """A figure's in a table's head."""
    return ROWS[name].symbol


def defined(name: str) -> str:
    """A line that says what a figure means."""
    return f"{ROWS[name].symbol}: {ROWS[name].meaning}."
