"""Sections of the page on which failures were found."""

from collections import Counter

from risk_sac.config import FamilyName
from risk_sac.records import Phase
from risk_sac.report.comparison import Comparison
from risk_sac.report.page import interval, table

MOST = 12  # rows of the table of clusters
NEXT = """
Of a failure in the folder of its run: `risk-sac show RUN ID --twin idle` draws it beside the same scene with nobody
attacking; `risk-sac minimise RUN ID` finds its core and `risk-sac region RUN ID` how many of its neighbours fail, and
the next report says both; `risk-sac bundle RUN ID --out FILE` puts it into a file; `risk-sac regress --failures RUN...
--ego EGO` plays all of them against another ego.
"""
CORES = ["failure", "what happens", "adversaries that act", "segments of 0.5 s", "copies of the core that fail"]


def clusters(comparison: Comparison, family: FamilyName) -> str:
    """The kinds of failures that all methods have found together, and one of each to look at."""
    found = comparison.overviews.get(family)
    if found is None or not found.clusters:
        return ""
    rows = (
        [each.name, str(each.failures), str(each.distinct), str(each.preventable), f"`{each.representative}`"]
        for each in found.clusters[:MOST]
    )
    left_out = len(found.clusters) - MOST
    rest = f"\n{left_out} rarer kinds are in `table.json`.\n" if left_out > 0 else ""
    return (
        f"### Which failures there are: {family}\n\n{len(found.clusters)} kinds by all methods together. The distinct "
        f"ones are as various as {found.vendi:.1f} that have nothing in common (Vendi score); {found.covered} of the "
        f"{found.cells} cells of the taxonomy hold one.\n\n"
        + table(["kind", "failures", "distinct", "preventable", "look first at"], rows)
        + rest
        + NEXT
    )


def studies(comparison: Comparison, family: FamilyName) -> str:
    """The cores and the regions of failures that somebody has asked for."""
    found = comparison.studies(family)
    cores = [(id_, each.core) for id_, each in found.items() if each.core]
    regions = [(id_, each.region) for id_, each in found.items() if each.region]
    text = ""
    if cores:
        rows = (
            [
                f"`{id_}`",
                core.sentence,
                f"{core.before.adversaries} → {core.after.adversaries}",
                f"{core.before.segments} → {core.after.segments}",
                f"{core.held} of {core.copies}",
            ]
            for id_, core in cores
        )
        text += f"### Cores of failures: {family}\n\n" + table(CORES, rows, left=2)
    if regions:
        columns = ["failure", *(share.what for share in regions[0][1].shares), "a needle"]
        shares = (
            [
                f"`{id_}`",
                *(
                    f"{share.failed} of {share.played}{interval(share.low, share.high, '.2f')}"
                    for share in region.shares
                ),
                "yes" if region.needle else "no",
            ]
            for id_, region in regions
        )
        text += f"\n### How many neighbours fail: {family}\n\n" + table(columns, shares)
    return text


def signatures(comparison: Comparison, family: FamilyName, phase: Phase) -> str:
    """How often each class of failures was found, the most frequent first."""
    cells = [cell for cell in comparison.group(family, phase) if cell.signatures]
    total = sum((Counter(cell.signatures) for cell in cells), Counter[str]())
    if not total:
        return ""
    columns = ["signature", *(cell.method for cell in cells)]
    rows = ([name, *(str(cell.signatures.get(name, 0)) for cell in cells)] for name, _ in total.most_common())
    return f"### Valid failures by signature: {family}, {phase}\n\n" + table(columns, rows)
