"""`risk-sac campaigns failures`: lists, draws and fetches failures over REST."""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, get_args

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from risk_sac.cli.campaigns.output import add_campaign_command, add_newest_command, chosen_id
from risk_sac.cli.console import OK, OUTCOME, in_words, offences, or_dash, outcome, print_answer, write_out
from risk_sac.cli.flags import WEIGHT, add_filter_flags, listed, wanted
from risk_sac.cli.parser import FAILURE_HELP, Commands, Parser
from risk_sac.client import Client, Episode
from risk_sac.errors import ConfigError
from risk_sac.failures.question import Twin
from risk_sac.failures.studied import Aim
from risk_sac.host.terminal import notes
from risk_sac.records import Collision, EpisodeId, Violation


def add(commands: Commands) -> None:
    """Adds the commands."""
    parser = add_newest_command(
        commands,
        "list",
        _list,
        "list the failures of a campaign",
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
    """Returns the id of the failure that an id, or the end of one, names.

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


def look_command(service_url: str, campaign_id: str, failure_id: str) -> str:
    """Returns the command that shows a failure."""
    return f"risk-sac campaigns failures show {campaign_id} {failure_id} --url {service_url}"


def _list(options: argparse.Namespace) -> int:
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
    """A failure in words."""
    yield f"{failure.id}: {failure.outcome}{f' ({in_words([failure.reason])})' if failure.reason else ''}"
    if failure.driven_by is not None:
        yield f"  driven by  {failure.driven_by}"
    if failure.collision is not None:
        yield from _contact(failure.collision)
    for violation in failure.violations:
        yield from _violation(violation)


def _violation(violation: Violation) -> Iterator[str]:
    actor = f"; the {violation.other_role} {violation.other_id!r} is next" if violation.other_id else ""
    yield (
        f"  violation  of {violation.requirement} from {or_dash(violation.time_s, '.1f')} s after the adversaries' "
        f"release, at {or_dash(violation.ego_speed_mps, '.1f')} m/s; least robustness "
        f"{or_dash(violation.robustness, '.2f')} scales{actor}"
    )
    yield f"  kind       {violation.kind}"
    yield f"  variant    {violation.variant}"
    yield f"  grade      {_grade(violation)}"
    yield from _plausible(violation)
    if violation.fault:
        yield f"  fault      {violation.fault}"
    yield f"  the ego    broke {in_words(violation.broke) or 'nothing'}"


def _grade(violation: Collision | Violation) -> str:
    return violation.graded or "none: it is not valid"


def _plausible(violation: Collision | Violation) -> Iterator[str]:
    if violation.behaviour is not None:
        yield f"  plausible  {violation.behaviour.in_words}"


def _contact(collision: Collision) -> Iterator[str]:
    yield (
        f"  contact    {or_dash(collision.time_s, '.1f')} s after the adversaries' release: the ego's "
        f"{collision.ego_zone} at {or_dash(collision.ego_speed_mps, '.1f')} m/s, the {collision.other_zone} of "
        f"{collision.other_role} {collision.other_id!r} at {or_dash(collision.other_speed_mps, '.1f')} m/s"
    )
    judgement = collision.judgement
    yield f"  kind       {judgement.kind}"
    yield f"  variant    {judgement.variant}"
    yield f"  grade      {_grade(collision)}"
    yield from _plausible(collision)
    yield f"  severity   {collision.severity_in_words}"
    if judgement.fault:
        yield f"  fault      {judgement.fault}"
    yield f"  the ego    broke {in_words(judgement.ego_broke) or 'nothing'}"
    yield f"  the other  broke {in_words(judgement.broke) or 'nothing'}"
