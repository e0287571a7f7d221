"""`risk-sac campaigns`: a service's campaigns, from a terminal or CI job."""

import argparse
import itertools
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, get_args

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from risk_sac.cli.campaigns.watch import add_campaign_command, add_watch, chosen_id, line, shown
from risk_sac.cli.console import (
    ABOVE,
    COULD_NOT_RUN,
    EGO,
    OK,
    OUTCOME,
    in_words,
    offences,
    on_one_line,
    or_dash,
    outcome,
    print_answer,
    write_out,
)
from risk_sac.cli.flags import add_limit, named_ego
from risk_sac.cli.parser import FAILURE_HELP, Commands, Parser, add_command, add_group, add_json_flag
from risk_sac.cli.regress import cases_table, junit
from risk_sac.cli.report import OUT, format_of
from risk_sac.cli.show import WEIGHT, add_filter_flags, listed, wanted
from risk_sac.client import CampaignSummary, Client, Episode
from risk_sac.errors import ConfigError
from risk_sac.failures.question import Twin
from risk_sac.failures.studied import Aim, Regression
from risk_sac.host.terminal import complain, notes
from risk_sac.records import Collision, EpisodeId, State, Violation

POLL_S = 0.5
FILTERS = ("state", "family", "method", "label", "tag")


def add_management(commands: Commands) -> None:
    """Adds the commands."""
    parser = add_command(
        commands, "list", _list, "list campaigns, newest first", example="campaigns list --state running"
    )
    for name in FILTERS:
        shown = name.replace("family", "scenario")
        parser.group("choice of campaigns").add_argument(
            f"--{shown}", dest=name, metavar=shown.upper(), help=f"only this {shown}"
        )
    add_limit(parser)

    parser = add_campaign_command(
        commands, "cancel", _cancel, "stop a campaign and keep what it found", example="campaigns cancel ID --wait"
    )
    parser.group("waiting").add_argument("--wait", action="store_true", help="return once it has ended")

    add_campaign_command(
        commands,
        "delete",
        _delete,
        "delete a campaign that has ended, with all it found",
        example="campaigns delete ID",
    )

    parser = add_campaign_command(
        commands,
        "report",
        _report,
        "write one file on what a campaign found, with bounds, coverage and limits",
        newest=True,
        example="campaigns report --out report.html",
    )
    output = parser.group("output")
    output.add_argument("--regression", metavar="ID", help="add the outcome of this regression")
    output.add_argument("--out", type=Path, required=True, metavar="FILE", help=OUT)

    parser = add_campaign_command(
        commands,
        "regress",
        _regress,
        "play the distinct failures of an ended campaign against another ego",
        example="campaigns regress ID --ego careful --junit regress.xml",
    )
    parser.group("cases").add_argument("--ego", required=True, metavar="EGO", help=EGO)
    junit_help = "report for CI: a case per failure"
    parser.group("output").add_argument("--junit", type=Path, metavar="FILE.xml", help=junit_help)


def _list(options: argparse.Namespace) -> int:
    filters = {name: getattr(options, name) for name in FILTERS}
    with Client.from_environment(options.url) as client:
        found = list(itertools.islice(client.campaigns(**filters), options.limit))
    print_answer(options, found, campaigns_table(found))
    return OK


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


def _cancel(options: argparse.Namespace) -> int:
    with Client.from_environment(options.url) as client:
        campaign = client.cancel(options.id)
        if options.wait:
            with shown() as show:
                campaign = client.wait(options.id, show)
    print_answer(options, campaign, line(campaign))
    return OK


def _delete(options: argparse.Namespace) -> int:
    with Client.from_environment(options.url) as client:
        client.delete(options.id)
    print_answer(options, {"id": options.id, "deleted": True}, f"{options.id} deleted")
    return OK


def _report(options: argparse.Namespace) -> int:
    format_ = format_of(options.out)
    with Client.from_environment(options.url) as client:
        content = client.report(chosen_id(client, options), format_, options.regression)
    write_out(options.out, content.encode(), "Report", notes)
    return OK


def _regress(options: argparse.Namespace) -> int:
    ego = named_ego(options.ego)
    with Client.from_environment(options.url) as client:
        regression = client.regress(options.id, ego)
        while not regression.state.final:
            time.sleep(POLL_S)
            regression = client.regression(regression.id)
    if regression.state is not State.SUCCEEDED:
        complain(f"{regression.id} {regression.state}: {regression.reason}")
        return COULD_NOT_RUN
    record = Regression(ego=regression.ego, cases=regression.cases)
    if options.junit is not None:
        write_out(options.junit, junit(record))
    print_answer(options, regression, cases_table(record))
    return OK if record.passed else ABOVE


EPILOG = """exit status:
  0    fine
  1    a bound is broken: the upper end of the 95 % interval of a rate is above
       --max-ecr, --max-pcr or --max-rate (with --judge-by rate: the rate), or
       there are more distinct preventable failures than --max-preventable, or a
       kind that --no-new-failures does not know; controls such as no-adversary
       count like any other method
  2    it could not run: the campaign failed, was cancelled or (with a bound)
       has not ended; the service refuses or does not answer; the time is up; an
       argument is wrong
  130  interrupted; the campaign goes on

environment:
  RISK_SAC_URL           address of the service, where no --url is given
                         (default: http://127.0.0.1:8000)
  RISK_SAC_API_KEY       the key, if the service asks for one
  RISK_SAC_API_KEY_FILE  a file that holds it

Results go to standard output; progress and errors go to standard error."""


def add(commands: Commands) -> None:
    """Adds the group of commands."""
    group = add_group(
        commands,
        "campaigns",
        "submit, follow and read campaigns of a running service",
        example="campaigns submit --scenario low --watch --max-pcr 0.1",
        epilog=EPILOG,
    )
    campaigns = group.add_subparsers(required=True, metavar="COMMAND")
    add_watch(campaigns)
    add_management(campaigns)
    leaves = list(campaigns.choices.values())
    of_failures = add_group(
        campaigns, "failures", "list, draw and fetch the failures of a campaign", example="campaigns failures list"
    )
    each = of_failures.add_subparsers(required=True, metavar="COMMAND")
    add_failures(each)
    for parser in (*leaves, *each.choices.values()):
        parser.set_defaults(on_error=COULD_NOT_RUN)
        parser.group("service").add_argument("--url", metavar="URL", help="address of the service")
        add_json_flag(parser)


def add_failures(commands: Commands) -> None:
    """Adds the commands."""
    parser = add_campaign_command(
        commands,
        "list",
        _list_failures,
        "list the failures of a campaign",
        newest=True,
        example="campaigns failures list --preventable --distinct --sort severity",
    )
    add_filter_flags(parser)
    parser.group("choice of failures").add_argument("--run", metavar="RUN", help="only those of this run")

    parser = add_campaign_command(
        commands,
        "show",
        _show,
        "print one failure in words and draw it",
        example="campaigns failures show ID low-risk-sac-0-search-39 --out failure.png",
    )
    _add_failure(parser)
    twins = get_args(Twin)
    twin = f"draw beside it the same scene without an attack (idle), or with another ego: {', '.join(twins)}"
    picture = parser.group("picture")
    picture.add_argument("--twin", choices=twins, metavar="TWIN", help=twin)
    picture.add_argument("--out", type=Path, metavar="FILE.png", help="(default: FAILURE.png)")

    parser = add_campaign_command(
        commands,
        "bundle",
        _bundle,
        "fetch one failure as a file that can be replayed alone",
        example="campaigns failures bundle ID low-risk-sac-0-search-39 --out failure.npz",
    )
    _add_failure(parser)
    output = parser.group("output")
    output.add_argument(
        "--minimise",
        choices=get_args(Aim),
        metavar="AIM",
        help="smallest: only what makes the ego fail, which takes the service 10 s; most-plausible: the least unlikely "
        "motion that still fails, which takes 20 s",
    )
    output.add_argument("--out", type=Path, metavar="FILE.npz", help="(default: FAILURE.npz)")


def _add_failure(parser: Parser) -> None:
    parser.add_argument("failure", metavar="FAILURE", help=FAILURE_HELP)


def _id_of(client: Client, campaign_id: str, named: str) -> str:
    """Returns the failure's id for an id or the end of one.

    Raises:
      ConfigError: no failure has this number, or those of several runs have.
    """
    wanted = EpisodeId.parse(named)
    if not named.isdecimal() and (wanted is None or wanted.run_id):
        return named
    ids = [failure.id for failure in client.failures(campaign_id, tier="raw")]
    matches = [id_ for id_ in ids if id_.rpartition("-")[2] == named or id_.endswith(str(wanted))]
    if len(matches) != 1:
        listing = f"`risk-sac campaigns failures list {campaign_id} --raw` lists them"
        got = f"{named}, which is the number of {len(matches) or 'no'} failure{'s' * (len(matches) > 1)}"
        raise ConfigError("FAILURE", got, f"one of {', '.join(matches)}" if matches else "the id of one", listing)
    return matches[0]


def _list_failures(options: argparse.Namespace) -> int:
    filters: dict[str, Any] = wanted(options) | {"order": "weight" if options.sort == WEIGHT else "arrival"}
    with Client.from_environment(options.url) as client:
        found = client.failures(
            chosen_id(client, options), tier="raw" if options.raw else "valid", run=options.run, **filters
        )
        failures = listed(options, found)
    print_answer(options, failures, failures_table(failures) if failures else "No failures to list.")
    return OK


def _bundle(options: argparse.Namespace) -> int:
    with Client.from_environment(options.url) as client:
        failure_id = _id_of(client, options.id, options.failure)
        content = client.bundle(options.id, failure_id, aim=options.minimise)
    file = options.out or Path(f"{failure_id}.npz")
    write_out(file, content, "Bundle", notes)
    return OK


def _show(options: argparse.Namespace) -> int:
    if options.out is not None and options.out.suffix != ".png":
        raise ConfigError("--out", f"{str(options.out)!r}", "a name that ends in .png")
    with Client.from_environment(options.url) as client:
        failure = client.failure(options.id, _id_of(client, options.id, options.failure))
        drawn = client.picture(options.id, failure.id, options.twin)
    picture = options.out or Path(f"{failure.id}.png")
    print_answer(options, failure, "\n".join(_lines(failure)))
    write_out(picture, drawn, "Drawn", notes)
    return OK


def failures_table(failures: Sequence[Episode]) -> Table:
    """At most four lines per failure; 80 columns hold it."""
    table = Table(box=SIMPLE_HEAD, padding=0)
    table.add_column("id, what it violates,\nand its kind", overflow="fold")
    table.add_column(OUTCOME, no_wrap=True)
    table.add_column("speed of ego,\nother, m/s", no_wrap=True, justify="right")
    table.add_column("failed rules,\nor offences")
    for failure in failures:
        worst = failure.worst_violation
        if worst is None:
            continue
        speeds = [worst.ego_speed_mps, *([worst.other_speed_mps] if isinstance(worst, Collision) else [])]
        table.add_row(
            escape(f"{failure.id}\n{', '.join(failure.failed or [worst.requirement])}\n{worst.kind}"),
            outcome(failure, worst),
            ", ".join(or_dash(speed, ".1f") for speed in speeds),
            escape("\n".join([in_words([failure.reason])] if failure.reason else offences(worst))),
        )
    return table


def _lines(failure: Episode) -> Iterator[str]:
    yield f"{failure.id}: {failure.outcome}{f' ({in_words([failure.reason])})' if failure.reason else ''}"
    if failure.driven_by is not None:
        yield f"  driven by  {failure.driven_by}"
    contact = () if failure.collision is None else (failure.collision,)
    for violation in (*contact, *failure.violations):
        yield from (f"  {name:10} {said}" for name, said in _told(violation).items() if said)


def _told(violation: Collision | Violation) -> dict[str, str | None]:
    if isinstance(violation, Violation):
        broken, severity = {"the ego": violation.broke}, None
    else:
        judgement, severity = violation.judgement, violation.severity_in_words
        broken = {"the ego": judgement.ego_broke, "the other": judgement.broke}
    return {
        **dict([_event(violation)]),
        "kind": violation.kind,
        "variant": violation.variant,
        "grade": violation.graded or "none: it is not valid",
        "plausible": None if violation.behaviour is None else violation.behaviour.in_words,
        "severity": severity,
        "fault": violation.blamed,
        **{who: f"broke {in_words(broke) or 'nothing'}" for who, broke in broken.items()},
    }


def _event(violation: Collision | Violation) -> tuple[str, str]:
    speed = or_dash(violation.ego_speed_mps, ".1f")
    time = f"{or_dash(violation.time_s, '.1f')} s after the adversaries' release"
    actor = f"{violation.other_role} {violation.other_id!r}"
    if isinstance(violation, Violation):
        robustness = f"least robustness {or_dash(violation.robustness, '.2f')} scales"
        following = f"; the {actor} is next" if violation.other_id else ""
        return "violation", f"of {violation.requirement} from {time}, at {speed} m/s; {robustness}{following}"
    other = f"the {violation.other_zone} of {actor} at {or_dash(violation.other_speed_mps, '.1f')} m/s"
    return "contact", f"{time}: the ego's {violation.ego_zone} at {speed} m/s, {other}"
