"""Writes the report of a campaign as a document.

It says what was found, how often it happens, what is not covered, and what to doubt.
"""

from collections.abc import Iterator

import yaml

from risk_sac.records import Power
from risk_sac.report.comparison import Comparison
from risk_sac.report.evidence.document import Block, Commands, Document, Items, Section, Table
from risk_sac.report.evidence.gathered import Evidence
from risk_sac.report.evidence.looked import bounds, coverage, odd
from risk_sac.report.evidence.origin import Origin, again
from risk_sac.report.evidence.searched import budget, clusters, funnel, regression, worth
from risk_sac.report.evidence.words import ego_in_words
from risk_sac.report.page import DASH, number, platform_in_words, versions_in_words

BANNER = (
    "Search results are no crash rate. The search looks for what goes wrong, so its counts say that something can "
    "happen, never how often. Only the section on unsearched scenes says how often, and only for such scenes."
)
LIMITS = (
    "A search that finds nothing has not shown that there is nothing: another seed, method or budget may find it.",
    "The bounds hold for scenes drawn uniformly over the ODD in this simulator, with the two kinds of traffic that are "
    "named. Roads have other shares. Scenes that were refused as infeasible are in no bound.",
    "Each bound holds by itself with 95 % confidence, not all of them together.",
    "The ego is what the simulator drives under the settings above, and no vehicle. What it perceives is a model.",
    "Of the environment, scenes know friction, visibility, and where the ODD states it night; drops on a sensor, and "
    "other road users than vehicles and pedestrians, are not in them.",
    "Coverage counts where scenes begin. What unfolds from one beginning differs with what the others do.",
    "Preventable is judged by models of drivers in the ego's place; the striker's motion is kept as it was.",
    "Numbers are those of one kind of processor; on another one the same commands give other digits.",
)


def report(comparison: Comparison, evidence: Evidence, origin: Origin, power: Power) -> Document:
    """The whole report of the runs that have finished; `power`: of their budget."""
    sections = [
        odd(comparison),
        budget(comparison),
        funnel(comparison),
        clusters(comparison, origin),
        regression(origin),
        worth(power, any(cell.failures for cell in comparison.cells)),
        bounds(comparison, evidence),
        coverage(evidence),
        _limits(comparison),
        _redo(comparison, origin),
    ]
    label = comparison.spec.label
    title = f"Failures of an ego: {label}" if label else f"Failures of an ego: {', '.join(comparison.spec.families)}"
    return Document(title=title, banner=BANNER, facts=tuple(_facts(comparison)), sections=sections)


def _facts(comparison: Comparison) -> Iterator[tuple[str, str]]:
    spec = comparison.spec
    yield "headline failures", number(comparison.headline, "d")
    yield "ego", ego_in_words(spec.ego)
    yield "its version", _versions(comparison)
    yield "families", ", ".join(spec.families)
    yield "methods", ", ".join(comparison.methods)
    yield "seeds", ", ".join(map(str, spec.seeds))
    yield "runs", _finished(comparison)
    yield "campaign", spec.digest
    yield "software", versions_in_words(comparison.versions) or DASH
    yield "made on", platform_in_words()


def _versions(comparison: Comparison) -> str:
    """A registered ego's own; one of SUMO's models is what these two packages are."""
    ego = comparison.spec.ego
    if ego.driver is not None:
        return ego.version or "not told"
    named = {name: version for name, version in comparison.versions.items() if name in ("libsumo", "risk-sac")}
    return versions_in_words(named) or "unknown: no run has finished"


def _finished(comparison: Comparison) -> str:
    every = len(comparison.runs) + len(comparison.missing)
    text = f"{len(comparison.runs)} of {every} searches"
    if comparison.spec.iid is None:
        return f"{text}; no i.i.d. phase"
    return f"{text}; {len(comparison.drawn)} of {len(comparison.drawn) + len(comparison.undrawn)} of the i.i.d. phase"


def _limits(comparison: Comparison) -> Section:
    items = list(LIMITS)
    if not all(run.verified for run in (*comparison.runs, *comparison.drawn)):
        items.append("Not all runs had their failures replayed: some may not repeat (risk-sac verify replays them).")
    if invalid := sum(cell.invalid for cell in comparison.cells):
        items.append(f"In {invalid} episodes of the search the ego failed to drive: they are in no rate.")
    blocks: list[Block] = [Items(items)]
    if comparison.missing:
        rows = [[run.spec.family, run.spec.method, str(run.spec.seed), run.reason] for run in comparison.missing]
        blocks += [
            f"{len(rows)} runs are missing, and in no number above:",
            Table("missing runs", ["family", "method", "seed", "why"], rows, left=4),
        ]
    return Section("limits", "Limits", blocks)


def _redo(comparison: Comparison, origin: Origin) -> Section:
    blocks: list[Block] = [
        "The whole campaign, budget and funnel:",
        Commands([comparison.command]),
        "This report, its kinds of failures and its pictures:",
        Commands([origin.report]),
        "Bounds, bins, all pairs and cells, as JSON:",
        Commands([origin.data]),
    ]
    runs = (*comparison.runs, *comparison.drawn)
    if comparison.spec_command:
        blocks += ["The campaign's settings, spec.yaml:", Commands([comparison.spec_command])]
    else:
        blocks += ["The campaign's settings, to be put into spec.yaml:", Commands([_settings(comparison)])]
    if runs:
        rows = [[run.spec.id, str(len(run.records)), run.digest[:16]] for run in runs]
        blocks += [
            f"One run. Its results.json then has the digest {runs[0].digest}:",
            Commands([again(comparison, runs[0])]),
            "The others go the same way, by their family, method and seed:",
            Table("runs", ["run", "episodes", "digest"], rows),
        ]
    return Section("again", "Each number again", blocks)


def _settings(comparison: Comparison) -> str:
    """As YAML, with all defaults, so that another version's do not matter."""
    told = comparison.spec.model_dump(mode="json")
    return yaml.safe_dump(told, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110).strip()
