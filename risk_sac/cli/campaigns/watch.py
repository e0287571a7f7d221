"""`risk-sac campaigns` submit, watch and results: follows a campaign and judges its results."""

import argparse
import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.progress import BarColumn, Progress

from risk_sac.cli.campaigns.gate import JUDGED_BY, GateBounds, named_rate, verdict
from risk_sac.cli.campaigns.junit import junit
from risk_sac.cli.campaigns.output import add_newest_command, chosen_id, figures, line, results_tables
from risk_sac.cli.console import OK, Board, columns, number, print_answer, say_adjustments
from risk_sac.cli.flags import (
    add_campaign_flags,
    add_place_flags,
    add_prior_flag,
    add_scene_flags,
    campaign_flags,
    scene_flags,
)
from risk_sac.cli.parser import Commands, Parser, add_command
from risk_sac.cli.scenarios import document_at, is_file
from risk_sac.client import Campaign, Client, Episode, Results
from risk_sac.config import CampaignSpec
from risk_sac.config.spec_file import read_posted
from risk_sac.env.problem import adjustments
from risk_sac.errors import ConfigError
from risk_sac.host.terminal import complain, notes
from risk_sac.records import Grade
from risk_sac.scenario import library
from risk_sac.scenario.shipped import nets_of

SEEDS = 1  # number of seeds if neither the file nor a flag names any
RATE = number(float, 0, 1)
MAP_UPLOADED = "in place of families: id or label of an uploaded map"
TAG = "word to find the campaign by; may be repeated"
NAMED_FAILURES = 5  # most failures that a JUnit report names per run


def add(commands: Commands) -> None:
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
    add_place_flags(parser, MAP_UPLOADED)
    service = parser.group("service")
    service.add_argument("--label", metavar="TEXT", help="text to find the campaign by")
    service.add_argument("--tag", dest="tags", action="append", metavar="WORD", help=TAG)
    key = "the same key gives the same campaign, however often it is submitted"
    service.add_argument("--idempotency-key", metavar="KEY", help=key)
    service.add_argument("--watch", action="store_true", help="go on as `watch` does")
    _add_watch_flags(parser)

    example = "campaigns watch --max-ecr 0.2 --junit junit.xml"
    parser = add_newest_command(
        commands, "watch", _watch, "follow a campaign to its end and judge its results", example=example
    )
    _add_watch_flags(parser)

    example = "campaigns results --max-ecr 0.2"
    parser = add_newest_command(commands, "results", _results, "show the results of a campaign so far", example=example)
    _add_gate_flags(parser)


def _add_watch_flags(parser: Parser) -> None:
    _add_gate_flags(parser)
    timeout = "give up after so many seconds"
    parser.group("service").add_argument("--timeout", type=number(float, 0.001), metavar="S", help=timeout)


def _prepare(options: argparse.Namespace) -> GateBounds:
    """Checks the bounds and makes the report's folder, so that nothing is waited for in vain."""
    bounds = GateBounds.of(options)
    if options.junit is not None:
        options.junit.parent.mkdir(parents=True, exist_ok=True)
    return bounds


def _check_names(bounds: GateBounds, spec: CampaignSpec) -> None:
    """Refuses a bound of a requirement that no campaign ships and this one does not add."""
    if bounds.requirements:
        from risk_sac.risk.requirements import SHIPPED_REQUIREMENTS  # here, because loading it takes a while

        bounds.check_names([*SHIPPED_REQUIREMENTS, *(each.name for each in spec.requirements)])


def _follow(client: Client, campaign_id: str, options: argparse.Namespace) -> int:
    """Follows a campaign to its end, shows what it found and judges it."""
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
        _report(client, results, bounds, options.junit)
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


def _report(client: Client, results: Results, bounds: GateBounds, file: Path) -> None:
    failures = {
        run.id: _first_failures(client, results.campaign_id, run.id)
        for run in results.runs
        if run.metrics is not None and run.metrics.failures
    }
    url = client.url_of(results.campaign_id)
    junit(results, client.url, url, bounds, failures).write(str(file), pretty=True)


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
    """Returns the id of the uploaded network with a label; the service refuses unknown ones."""
    matches = [network for network in client.networks() if called in (network.id, network.label)]
    if len(matches) > 1:
        ids = ", ".join(network.id for network in matches)
        raise ConfigError("network", f"{called!r}, the label of {len(matches)} networks", "the id of one", f"of {ids}")
    return matches[0].id if matches else called


def _uploaded(name_or_file: str, url: str | None) -> str:
    """Returns the name of a scenario in the service; a file is uploaded with its nets."""
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
