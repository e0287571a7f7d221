"""`risk-sac campaigns` submit, watch, results: follows a campaign and judges results."""

import argparse
import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.progress import BarColumn, Progress
from rich.table import Table

from risk_sac.cli.campaigns.gate import (
    JUDGED_BY,
    BoundCheck,
    GateBounds,
    comparisons,
    junit,
    measured,
    named_rate,
    verdict,
)
from risk_sac.cli.console import (
    OK,
    Board,
    columns,
    counted,
    headline,
    number,
    on_one_line,
    or_dash,
    print_answer,
    requirements_table,
    say_adjustments,
)
from risk_sac.cli.flags import (
    add_campaign_flags,
    add_place_flags,
    add_prior_flag,
    add_scene_flags,
    campaign_flags,
    document_at,
    is_file,
    scene_flags,
)
from risk_sac.cli.parser import Commands, Parser, add_command
from risk_sac.client import Campaign, CampaignSummary, Client, Episode, Results
from risk_sac.config import IID_METHODS, CampaignSpec
from risk_sac.config.spec_file import read_posted
from risk_sac.env.problem import adjustments
from risk_sac.errors import ConfigError
from risk_sac.host.terminal import complain, notes
from risk_sac.metrics import pooled_requirements, with_published
from risk_sac.records import DrivenBy, Grade, Total
from risk_sac.scenario import library
from risk_sac.scenario.reading import nets_of

SEEDS = 1  # number of seeds if neither the file nor a flag names any
RATE = number(float, 0, 1)
TAG = "word to find the campaign by; may be repeated"
NAMED_FAILURES = 5  # most failures that a JUnit report names per run


def add_watch(commands: Commands) -> None:
    """Adds the commands."""
    parser = add_command(
        commands,
        "submit",
        _submit,
        "queue a campaign",
        more="With --watch, follows it, shows its results and judges them as `watch` does.",
        example="campaigns submit --scenario low --episodes 50 --watch --max-pcr 0.1",
    )
    add_campaign_flags(parser, families="the file's", methods="risk-sac", seeds=SEEDS)
    add_scene_flags(parser)
    add_prior_flag(parser, "the id of an earlier campaign")
    add_place_flags(parser, "in place of families: id or label of an uploaded map")
    service = parser.group("service")
    service.add_argument("--label", metavar="TEXT", help="text to find the campaign by")
    service.add_argument("--tag", dest="tags", action="append", metavar="WORD", help=TAG)
    key = "the same key gives the same campaign, however often it is submitted"
    service.add_argument("--idempotency-key", metavar="KEY", help=key)
    service.add_argument("--watch", action="store_true", help="go on as `watch` does")
    _add_watch_flags(parser)

    example = "campaigns watch --max-ecr 0.2 --junit junit.xml"
    parser = add_campaign_command(
        commands, "watch", _watch, "follow a campaign to its end and judge its results", newest=True, example=example
    )
    _add_watch_flags(parser)

    example = "campaigns results --max-ecr 0.2"
    parser = add_campaign_command(
        commands, "results", _results, "show the results of a campaign so far", newest=True, example=example
    )
    _add_gate_flags(parser)


def _add_watch_flags(parser: Parser) -> None:
    _add_gate_flags(parser)
    timeout = "give up after so many seconds"
    parser.group("service").add_argument("--timeout", type=number(float, 0.001), metavar="S", help=timeout)


def _prepare(options: argparse.Namespace) -> GateBounds:
    """Checks bounds and makes the report's folder, before any waiting."""
    bounds = GateBounds.of(options)
    if options.junit is not None:
        options.junit.parent.mkdir(parents=True, exist_ok=True)
    return bounds


def _check_names(bounds: GateBounds, spec: CampaignSpec) -> None:
    """Refuses bounds of requirements neither shipped nor added by the campaign."""
    if bounds.requirements:
        from risk_sac.risk.requirements import SHIPPED_REQUIREMENTS  # here, because loading it takes a while

        bounds.check_names([*SHIPPED_REQUIREMENTS, *(each.name for each in spec.requirements)])


def _follow(client: Client, campaign_id: str, options: argparse.Namespace) -> int:
    try:
        with shown() as show:
            client.wait(campaign_id, show, timeout_s=options.timeout)
    except KeyboardInterrupt:
        complain(f"the campaign goes on; `risk-sac campaigns cancel {campaign_id}` stops it")
        raise
    return _conclude(client, campaign_id, options)


def _watch(options: argparse.Namespace) -> int:
    bounds = _prepare(options)
    with Client.from_environment(options.url) as client:
        campaign_id = chosen_id(client, options)
        _check_names(bounds, client.campaign(campaign_id).spec)
        return _follow(client, campaign_id, options)


def _results(options: argparse.Namespace) -> int:
    _prepare(options)
    with Client.from_environment(options.url) as client:
        return _conclude(client, chosen_id(client, options), options)


def _conclude(client: Client, campaign_id: str, options: argparse.Namespace) -> int:
    results, bounds = client.results(campaign_id), GateBounds.of(options)
    if options.junit is not None:
        begun = [run for run in results.runs if run.metrics is not None and run.metrics.failures]
        failures = {run.id: _first_failures(client, campaign_id, run.id) for run in begun}
        report = junit(results, client.url, client.url_of(campaign_id), bounds, failures)
        report.write(str(options.junit), pretty=True)
    print_answer(options, results, results_tables(results, bounds))
    say_adjustments(results.adjustments)
    for run in results.runs:
        if run.state == "failed":
            complain(f"{run.id}: {run.reason}")
    status, reason = verdict(results, bounds)
    if status == OK and reason:
        notes.print(reason, markup=False, soft_wrap=True)
    elif reason:
        complain(reason)
    return status


def _first_failures(client: Client, campaign_id: str, run_id: str) -> list[Episode]:
    """Of a run, the preventable ones first."""
    found: dict[str, Episode] = {}
    for grade in (Grade.PREVENTABLE, None):
        failures = client.failures(campaign_id, run=run_id, grade=grade, page=NAMED_FAILURES)
        found |= {failure.id: failure for failure in itertools.islice(failures, NAMED_FAILURES)}
    return list(found.values())[:NAMED_FAILURES]


def _add_gate_flags(parser: Parser) -> None:
    bounds = parser.group("bounds, for exit status 1")
    bounds.add_argument("--max-ecr", type=RATE, metavar="X", help="largest ECR of a family and method")
    bounds.add_argument("--max-pcr", type=RATE, metavar="X", help="largest PCR of a family and method")
    rate = "largest rate of this requirement, of the i.i.d. phase too; may be repeated"
    bounds.add_argument("--max-rate", type=named_rate, action="append", metavar="NAME=X", help=rate)
    preventable = "most distinct preventable failures of a family and method"
    bounds.add_argument("--max-preventable", type=number(int, 0), metavar="N", help=preventable)
    known = "no kind of failure that is not in an earlier campaign's `results --json`"
    bounds.add_argument("--no-new-failures", type=Path, metavar="KNOWN.json", help=known)
    judged = "compare the upper end of the rate's 95 %% interval, or the rate (default: interval)"
    bounds.add_argument("--judge-by", choices=JUDGED_BY, default=JUDGED_BY[0], help=judged)
    cases = "report for CI: a suite per family, a case per run and per requirement of a method"
    parser.group("output").add_argument("--junit", type=Path, metavar="FILE.xml", help=cases)


LINE_S = 10.0  # least time between two lines while the state does not change
AT_WORK = ("running", "cancelling")


@contextmanager
def shown() -> Iterator[Callable[[Campaign], None]]:
    """Yields a function that shows a campaign on standard error."""
    if not notes.is_interactive:
        yield _Lines()
        return
    with Progress(*columns(BarColumn(15)), console=notes) as bar:
        board = Board(bar)

        def draw(campaign: Campaign) -> None:
            progress = campaign.progress
            runs = {run.id: (run.episodes_done, run.episodes_total) for run in campaign.runs if run.state in AT_WORK}
            board.show(progress.episodes_done, progress.episodes_total, figures(campaign), runs)

        yield draw


class _Lines:
    def __init__(self) -> None:
        self._state = ""
        self._said = 0.0

    def __call__(self, campaign: Campaign) -> None:
        now = time.monotonic()
        if campaign.state != self._state or now - self._said >= LINE_S:
            self._state, self._said = campaign.state, now
            notes.print(line(campaign), markup=False, soft_wrap=True)


def _network_id(client: Client, called: object) -> object:
    """Returns an uploaded network's id by label; the service refuses unknown ones."""
    matches = [network for network in client.networks() if called in (network.id, network.label)]
    if len(matches) > 1:
        ids = ", ".join(network.id for network in matches)
        raise ConfigError("network", f"{called!r}, the label of {len(matches)} networks", "the id of one", f"of {ids}")
    return matches[0].id if matches else called


def _uploaded(name_or_file: str, url: str | None) -> str:
    """Returns a scenario's name in the service; uploads a file with nets."""
    if not is_file(name_or_file):
        return name_or_file
    document, folder = document_at(name_or_file)
    nets = library.own_files(document, nets_of(document, folder))
    with Client.from_environment(url) as client:
        return client.add_scenario(document, nets).name


def _submit(options: argparse.Namespace) -> int:
    for name in ("max_ecr", "max_pcr", "max_rate", "max_preventable", "no_new_failures", "junit", "timeout"):
        if getattr(options, name) is not None and not options.watch:
            raise ConfigError(f"--{name.replace('_', '-')}", "it without --watch", "both")
    bounds = _prepare(options)
    options.families = options.families and [_uploaded(name, options.url) for name in options.families]
    flags = campaign_flags(options, SEEDS) | scene_flags(options)
    flags |= {name: getattr(options, name) for name in ("label", "tags", "network", "pattern", "place", "places")}
    spec = read_posted(options.spec, flags)
    if isinstance(spec, CampaignSpec):
        _check_names(bounds, spec)
    if isinstance(spec, CampaignSpec) and not options.watch:
        say_adjustments(adjustments(spec))
    with Client.from_environment(options.url) as client:
        if not isinstance(spec, CampaignSpec):
            spec |= {"network": _network_id(client, spec["network"])}
        campaign = client.submit(spec, options.idempotency_key)
        if options.watch:
            notes.print(client.url_of(campaign.id), markup=False, soft_wrap=True)
            return _follow(client, campaign.id, options)
    print_answer(options, campaign, line(campaign))
    return OK


COUNTS = ("head-\nline", "epi-\nsodes", "fail-\nures", "dis-\ntinct", "preven-\ntable")
RATES = ("ECR\n95 %", "PCR\n95 %")


def add_campaign_command(
    commands: Commands,
    name: str,
    run: Callable[[argparse.Namespace], int],
    summary: str,
    *,
    example: str,
    newest: bool = False,
) -> Parser:
    """Adds a one-campaign command, optionally defaulting to the newest; returns its parser."""
    parser = add_command(commands, name, run, summary, example=example)
    default = " (default: the newest)" if newest else ""
    parser.add_argument("id", nargs="?" if newest else None, metavar="ID", help=f"id of the campaign{default}")
    return parser


def chosen_id(client: Client, options: argparse.Namespace) -> str:
    """Returns the named campaign's id, or that of the newest.

    Raises:
      ConfigError: the service has no campaign.
    """
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
    """Returns a campaign's findings in words, with its state's reason."""
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
    """Counts searches' failures by requirement, in brackets; empty without any."""
    runs = campaign.runs if isinstance(campaign, Campaign) else []
    searches = [run.metrics for run in runs if run.metrics is not None and run.method not in IID_METHODS]
    found = pooled_requirements(searches)
    counts = ", ".join(f"{name} {each.valid}" for name, each in found.items() if each.valid)
    return f" ({counts})" if counts else ""


def results_tables(results: Results, bounds: GateBounds) -> Group:
    """Returns funnel and requirements by family and method, broken bounds in red."""
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
    """Funnel, ECR and PCR by family and method, in 80 columns.

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
            _rate_cell(total.ecr, total.ecr_low, total.ecr_high, broken.get("ECR")),
            _rate_cell(total.pcr, total.pcr_low, total.pcr_high, broken.get("PCR")),
            style="red" if broken else None,
        )
    return table


def driven_by_table(results: Results) -> Table | None:
    """Counts episodes and headline failures by `DrivenBy`; None where unknown."""
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


def _rate_cell(rate: float | None, low: float | None, high: float | None, broken: BoundCheck | None) -> str:
    interval = f"{or_dash(low, '.2f')}-{or_dash(high, '.2f')}"
    said = "" if broken is None else "\nabove" if broken.verdict == "above" else f"\nup to {broken.upper:.2f}"
    return f"{or_dash(rate, '.2f')}\n{interval}{said}"
