"""Flags that filter, sort and bound a list of failures."""

import argparse
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from operator import itemgetter
from typing import Any, NamedTuple, TypeAlias, TypeVar

from risk_sac.cli.console import number
from risk_sac.cli.parser import Parser
from risk_sac.records import Collision, DrivenBy, EpisodeRecord, Fault, Grade, Severity, Violation
from risk_sac.terminal import notes
from risk_sac.verdicts.distinct import DistinctFailures

E = TypeVar("E", bound=EpisodeRecord)
Worst: TypeAlias = Collision | Violation
LIMIT = 20


class Filter(NamedTuple):
    """A flag that keeps the failures with a value."""

    what: str
    keeps: Callable[[EpisodeRecord, Worst, str], bool]
    choices: Sequence[str] | None = None


def _severity(worst: Worst) -> Severity | None:
    return worst.severity if isinstance(worst, Collision) else None


def _broke(worst: Worst) -> Sequence[str]:
    if isinstance(worst, Violation):
        return worst.broke
    return worst.judgement.broke if worst.judgement else ()


FILTERS: Mapping[str, Filter] = {
    "grade": Filter("of this grade", lambda _, worst, wanted: worst.graded == wanted, [*Grade]),
    "severity": Filter("of this severity", lambda _, worst, wanted: _severity(worst) == wanted, [*Severity]),
    "fault": Filter("caused by this party", lambda _, worst, wanted: worst.blamed == wanted, [*Fault]),
    "driven_by": Filter("whose adversaries this drove", lambda each, _, wanted: each.driven_by == wanted, [*DrivenBy]),
    "requirement": Filter(
        "that violate this requirement, such as no_contact", lambda each, _, wanted: wanted in each.failed
    ),
    "broke": Filter(
        "whose striker broke this rule, such as red_light", lambda _, worst, wanted: wanted in _broke(worst)
    ),
    "signature": Filter("with this kind, in the words of the list", lambda _, worst, wanted: worst.signature == wanted),
}


def _gravest(worst: Worst) -> tuple[int, bool, bool]:
    severity = _severity(worst)
    rank = [*Severity].index(severity) if severity else -1
    return -rank, not worst.preventable, worst.blamed is not Fault.EGO


SORTS: Mapping[str, Callable[[Worst], Any]] = {
    "severity": _gravest,
    "speed": lambda worst: -worst.ego_speed_mps,
}
SORTED_BY = "found (the order of the search), severity (the worst first) or speed (the fastest ego first)"


def add_filter_flags(parser: Parser) -> None:
    """Adds the flags of a list of failures."""
    group = parser.group("choice of failures")
    for name, each in FILTERS.items():
        choices = f": {', '.join(each.choices)}" if each.choices else ""
        what = f"only those {each.what}{choices}"
        flag = f"--{name.replace('_', '-')}"
        group.add_argument(flag, choices=each.choices, metavar=name.upper(), help=what)
    group.add_argument(
        "--preventable", dest="grade", action="store_const", const=str(Grade.PREVENTABLE), help="--grade preventable"
    )
    group.add_argument("--distinct", action="store_true", help="only the first of each kind")
    group.add_argument("--raw", action="store_true", help="also those that a validity rule refused")
    group.add_argument(
        "--sort", choices=["found", *SORTS], metavar="ORDER", default="found", help=f"by {SORTED_BY} (default: found)"
    )
    add_limit(parser)


def add_limit(parser: Parser) -> None:
    """Adds the flag that bounds a list."""
    least = number(int, 1)
    parser.group("output").add_argument(
        "--limit", type=least, default=LIMIT, metavar="N", help="at most (default: %(default)s)"
    )


def wanted(options: argparse.Namespace) -> dict[str, str | None]:
    """Returns the value of each filter; None where it was not given."""
    return {name: getattr(options, name) for name in FILTERS}


def matching(options: argparse.Namespace, failures: Iterable[E]) -> Iterator[E]:
    """Yields the failures that the filters keep."""
    given = {FILTERS[name].keeps: value for name, value in wanted(options).items() if value is not None}
    for failure in failures:
        worst = failure.worst_violation
        if worst is None or not (worst.valid or options.raw):
            continue
        if all(keeps(failure, worst, value) for keeps, value in given.items()):
            yield failure


def listed(options: argparse.Namespace, failures: Iterable[E]) -> list[E]:
    """Returns the failures to list, and notes on standard error if --limit leaves some out."""
    if options.distinct:
        failures = _first_of_each_kind(failures)
    if options.sort != "found":
        order = SORTS[options.sort]
        judged = ((order(worst), each) for each in failures if (worst := each.worst_violation))
        failures = [each for _, each in sorted(judged, key=itemgetter(0))]
    found = list(islice(failures, options.limit + 1))
    if len(found) > options.limit:
        notes.print(f"There are more: --limit is {options.limit}.")
    return found[: options.limit]


def _first_of_each_kind(failures: Iterable[E]) -> Iterator[E]:
    kinds = DistinctFailures()
    return (failure for failure in failures if sum(map(kinds.add, failure.valid_violations)))
