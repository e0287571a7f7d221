"""Campaigns and results as one line, a table, or JSON. What others wrote stays on its line."""

import argparse
from collections.abc import Callable, Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.markup import escape
from rich.table import Table

from risk_sac.cli.campaigns.gate import BoundCheck, GateBounds, comparisons, measured
from risk_sac.cli.console import counted, headline, on_one_line, or_dash, requirements_table
from risk_sac.cli.parser import Commands, Parser, add_command
from risk_sac.client import Campaign, CampaignSummary, Client, Results
from risk_sac.config import IID_METHODS
from risk_sac.errors import ConfigError
from risk_sac.host.terminal import notes
from risk_sac.metrics import pooled_requirements, with_published
from risk_sac.records import DrivenBy, Total

COUNTS = ("head-\nline", "epi-\nsodes", "fail-\nures", "dis-\ntinct", "preven-\ntable")
RATES = ("ECR\n95 %", "PCR\n95 %")


def add_campaign_command(
    commands: Commands, name: str, run: Callable[[argparse.Namespace], int], summary: str, *, example: str, **text: str
) -> Parser:
    """Adds a command on one campaign; returns its parser."""
    parser = add_command(commands, name, run, summary, example=example, **text)
    parser.add_argument("id", metavar="ID", help="id of the campaign")
    return parser


def add_newest_command(
    commands: Commands, name: str, run: Callable[[argparse.Namespace], int], summary: str, *, example: str, **text: str
) -> Parser:
    """Adds a command on one campaign, by default the newest; returns its parser."""
    parser = add_command(commands, name, run, summary, example=example, **text)
    parser.add_argument("id", nargs="?", metavar="ID", help="id of the campaign (default: the newest)")
    return parser


def chosen_id(client: Client, options: argparse.Namespace) -> str:
    """Returns the id of the campaign that the command line names, or of the newest; raises `ConfigError`."""
    if options.id is not None:
        return str(options.id)
    newest = next(client.campaigns(page=1), None)
    if newest is None:
        raise ConfigError("ID", "nothing", "the id of a campaign", "the service has none yet")
    notes.print(f"Newest campaign: {newest.id}", markup=False, soft_wrap=True)
    return newest.id


def line(campaign: CampaignSummary) -> str:
    """Returns the state and the findings of a campaign as one line."""
    episodes = f"{campaign.progress.episodes_done}/{counted(campaign.progress.episodes_total, 'episode')}"
    return f"{campaign.id} {campaign.state}: {episodes}, {figures(campaign)}"


def figures(campaign: CampaignSummary) -> str:
    """Returns the findings of a campaign in words, and the reason of its state."""
    progress = campaign.progress
    eta = "?" if progress.eta_s is None else f"{progress.eta_s:.0f} s"
    reason = f"; {campaign.state}, {on_one_line(campaign.reason)}" if campaign.reason else ""
    failures = f"{counted(progress.failures, 'failure')}{_by_requirement(campaign)}"
    first = (
        f"headline failures: {headline(progress.headline, progress.headline_candidates, progress.headline_published)}"
    )
    preventable = f"{progress.distinct_preventable} distinct and preventable"
    found = f"{first}; {failures}, {preventable} ({progress.distinct_published} by R157, FSM or RSS)"
    rates = f"ECR {or_dash(progress.window_ecr, '.2f')}, PCR {or_dash(progress.window_pcr, '.2f')}"
    return f"{found}, {rates}, ETA {eta}{reason}"


def _by_requirement(campaign: CampaignSummary) -> str:
    """In brackets, how many failures of the searches violate each requirement; empty without any."""
    runs = campaign.runs if isinstance(campaign, Campaign) else []
    searches = [run.metrics for run in runs if run.metrics is not None and run.method not in IID_METHODS]
    found = pooled_requirements(searches)
    counts = ", ".join(f"{name} {each.valid}" for name, each in found.items() if each.valid)
    return f" ({counts})" if counts else ""


def campaigns_table(campaigns: Sequence[CampaignSummary]) -> Table:
    """One row per campaign."""
    table = Table(box=SIMPLE_HEAD, padding=0)
    for name in ("id", "state", "head-\nline", "epi-\nsodes", "fail-\nures", "posted"):
        words = name in ("id", "state", "posted")
        table.add_column(name, no_wrap=True, justify="left" if words else "right")
    table.add_column("label")
    for campaign in campaigns:
        progress = campaign.progress
        table.add_row(
            campaign.id,
            campaign.state,
            or_dash(progress.headline, "d"),
            f"{progress.episodes_done}/{progress.episodes_total}",
            str(progress.failures),
            f"{campaign.created_at.astimezone():%Y-%m-%d %H:%M}",
            escape(on_one_line(campaign.label)),
        )
    return table


def results_tables(results: Results, bounds: GateBounds) -> Group:
    """Returns the funnel and the requirements of each family and method; broken bounds are red."""
    groups = {f"{group.family} {group.method}": group for group in measured(results)}
    said = {
        (name, each.name): f"above {each.bound:g}" if each.verdict == "above" else f"may be above {each.bound:g}"
        for name, group in groups.items()
        for each in group.comparisons(bounds)
        if each.verdict != "within"
    }
    requirements = requirements_table({name: group.requirements for name, group in groups.items()}, said)
    tables = (results_table(results, bounds), driven_by_table(results), requirements)
    return Group(*(table for table in tables if table is not None))


def results_table(results: Results, bounds: GateBounds) -> Table:
    """Per family and method the funnel, and ECR and PCR over their intervals; 80 columns hold it.

    The title has the headline failures of the campaign: what several methods found alike counts once there.
    Failures, distinct and preventable ones are of every requirement that counts. In brackets are those that R157, FSM
    or RSS prevents.
    """
    partial = "" if results.complete else ", so far"
    candidates = sum(total.headline_candidates for total in results.totals)
    found = headline(results.headline, candidates, results.headline_published)
    title = f"headline failures: {found}\n{results.campaign_id} {results.state}{partial}"
    table = Table(title=title, box=SIMPLE_HEAD, padding=0)
    table.add_column("family", overflow="fold")  # of a place on a map it is long
    table.add_column("method", no_wrap=True)
    for name in (*COUNTS, *RATES):
        table.add_column(name, no_wrap=True, justify="right")
    for total in results.totals:
        broken = {each.name: each for each in comparisons(total, bounds) if each.verdict != "within"}
        table.add_row(
            total.family,
            f"{total.method}\n{counted(total.runs, 'run')}",
            "-" if total.headline is None else with_published(total.headline, total.headline_published),
            *map(str, (total.episodes, total.failures, total.distinct_failures)),
            with_published(total.distinct_preventable, total.distinct_published),
            _rate(total.ecr, total.ecr_low, total.ecr_high, broken.get("ECR")),
            _rate(total.pcr, total.pcr_low, total.pcr_high, broken.get("PCR")),
            style="red" if broken else None,
        )
    return table


def driven_by_table(results: Results) -> Table | None:
    """A line for each family and method: episodes and headline failures by what drove them; None where unknown."""
    if not any(total.episodes_driven_by for total in results.totals):
        return None
    table = Table(title="episodes driven by (of them headline failures)", box=SIMPLE_HEAD, padding=0)
    table.add_column("family", overflow="fold")
    table.add_column("method", no_wrap=True)
    for each in DrivenBy:
        table.add_column(each, no_wrap=True, justify="right")
    for total in results.totals:
        table.add_row(total.family, total.method, *(_driven_by(total, each) for each in DrivenBy))
    return table


def _driven_by(total: Total, what: DrivenBy) -> str:
    headline = "" if total.headline is None else f" ({total.headline_driven_by.get(what, 0)})"
    return f"{total.episodes_driven_by.get(what, 0)}{headline}"


def _rate(rate: float | None, low: float | None, high: float | None, broken: BoundCheck | None) -> str:
    interval = f"{or_dash(low, '.2f')}-{or_dash(high, '.2f')}"
    said = "" if broken is None else "\nabove" if broken.verdict == "above" else f"\nup to {broken.upper:.2f}"
    return f"{or_dash(rate, '.2f')}\n{interval}{said}"
