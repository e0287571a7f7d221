"""`risk-sac campaigns failures`: what a campaign found, one by one, without the server's folder."""

import argparse
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import get_args

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from risk_sac.cli.campaigns.output import add_campaign_command, add_limit, print_answer
from risk_sac.cli.console import OK, OUTCOME, Commands, in_words, offences, or_dash, outcome, write_out
from risk_sac.client import Client, Episode
from risk_sac.errors import ConfigError
from risk_sac.failures.question import Twin
from risk_sac.records import Collision, DrivenBy, Fault, Grade, Severity, Violation
from risk_sac.terminal import notes, printable

CLASSES = {"grade": Grade, "severity": Severity, "fault": Fault}
FILTERS = {
    "run": "of this run",
    "requirement": "that violate this requirement, such as no_contact",
    "broke": "whose striker broke this, such as red_light",
    "signature": "of this class, in the words of the list",
}


def add(commands: Commands) -> None:
    """Add the commands."""
    parser = add_campaign_command(commands, "list", _list, "a campaign's failures, in the order they were found")
    for name, classes in CLASSES.items():
        parser.add_argument(f"--{name}", choices=[each.value for each in classes], help=f"only of this {name}")
    drove = [each.value for each in DrivenBy]
    parser.add_argument("--driven-by", choices=drove, help="only those whose adversaries this drove")
    for name, which in FILTERS.items():
        parser.add_argument(f"--{name}", metavar=name.upper(), help=f"only those {which}")
    parser.add_argument("--raw", action="store_true", help="contacts and violations too that a rule refused")
    add_limit(parser)

    parser = add_campaign_command(commands, "show", _show, "one failure in words and as a picture")
    _add_failure(parser)
    twin = "draw beside it the same scene without an attack (idle), or with another ego"
    parser.add_argument("--twin", choices=get_args(Twin), help=twin)
    parser.add_argument("--out", type=Path, metavar="FILE.png", help="the picture (default: FAILURE.png)")

    parser = add_campaign_command(commands, "bundle", _bundle, "fetch one failure as a file that stands alone")
    _add_failure(parser)
    parser.add_argument(
        "--core", action="store_true", help="only what makes the ego fail, which takes the service 10 s"
    )
    parser.add_argument("--out", type=Path, metavar="FILE.npz", help="(default: FAILURE.npz)")


def _add_failure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("failure", metavar="FAILURE", help="its id, as in the list")


def look_command(service_url: str, campaign_id: str, failure_id: str) -> str:
    """What to type to look at a failure."""
    return f"risk-sac campaigns failures show {campaign_id} {failure_id} --url {service_url}"


def _list(options: argparse.Namespace) -> int:
    filters = {name: getattr(options, name) for name in (*FILTERS, *CLASSES, "driven_by")}
    with Client.from_environment(options.url) as client:
        found = client.failures(options.id, tier="raw" if options.raw else "valid", **filters)
        failures = list(itertools.islice(found, options.limit + 1))
    print_answer(options, failures[: options.limit], failures_table(failures[: options.limit]))
    if len(failures) > options.limit:
        notes.print(f"There are more: --limit is {options.limit}.")
    return OK


def _bundle(options: argparse.Namespace) -> int:
    file = options.out or Path(f"{options.failure}.npz")
    with Client.from_environment(options.url) as client:
        content = client.bundle(options.id, options.failure, core=options.core)
    write_out(file, content, "Bundle", notes)
    return OK


def _show(options: argparse.Namespace) -> int:
    picture = options.out or Path(f"{options.failure}.png")
    if picture.suffix != ".png":
        raise ConfigError("--out", f"{str(picture)!r}", "a name that ends in .png")
    with Client.from_environment(options.url) as client:
        failure = client.failure(options.id, options.failure)
        drawn = client.picture(options.id, options.failure, options.twin)
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
            Text(printable(f"{failure.id}\n{', '.join(failure.failed or [worst.requirement])}\n{worst.signature}")),
            outcome(failure, worst),
            ", ".join(or_dash(speed, ".1f") for speed in speeds),
            Text(printable("\n".join([in_words([failure.reason])] if failure.reason else offences(worst)))),
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
    actor = f"; the {violation.other_role} {printable(violation.other_id)!r} is next" if violation.other_id else ""
    yield (
        f"  violation  of {violation.requirement} from {or_dash(violation.time_s, '.1f')} s after the adversaries' "
        f"release, at {or_dash(violation.ego_speed_mps, '.1f')} m/s; least robustness "
        f"{or_dash(violation.robustness, '.2f')} scales{actor}"
    )
    yield f"  kind       {printable(violation.signature)}"
    yield f"  grade      {_grade(violation)}"
    if violation.fault:
        yield f"  fault      {violation.fault}"
    yield f"  the ego    broke {in_words(violation.broke) or 'nothing'}"


def _grade(violation: Collision | Violation) -> str:
    return violation.graded or ("none: not judged" if violation.valid else "none: it is not valid")


def _contact(collision: Collision) -> Iterator[str]:
    yield (
        f"  contact    {or_dash(collision.time_s, '.1f')} s after the adversaries' release: the ego's "
        f"{collision.ego_zone} at {or_dash(collision.ego_speed_mps, '.1f')} m/s, the {collision.other_zone} of "
        f"{collision.other_role} {printable(collision.other_id)!r} at {or_dash(collision.other_speed_mps, '.1f')} m/s"
    )
    if (judgement := collision.judgement) is not None:
        yield f"  kind       {printable(judgement.signature)}"
        yield f"  grade      {_grade(collision)}"
        if collision.severity_in_words:
            yield f"  severity   {collision.severity_in_words}"
        if judgement.fault:
            yield f"  fault      {judgement.fault}"
        yield f"  the ego    broke {in_words(judgement.ego_broke) or 'nothing'}"
        yield f"  the other  broke {in_words(judgement.broke) or 'nothing'}"
