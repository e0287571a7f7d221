"""Flags of campaigns, runs, egos, places and lists of failures."""

import argparse
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, TypeVar, get_args

from risk_sac.cli.console import EGO, number
from risk_sac.cli.parser import Parser
from risk_sac.cli.scenarios import kept_name
from risk_sac.config import Behaviour, EgoConfig, FamilyName
from risk_sac.config.samplers import named_methods
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.registry import refuse_class
from risk_sac.errors import ConfigError
from risk_sac.host.terminal import notes
from risk_sac.maps.convert import present_net
from risk_sac.maps.finder import FINDERS, Map
from risk_sac.records import Collision, DrivenBy, EpisodeRecord, Fault, Grade, PlausibilityClass, Severity, Violation
from risk_sac.run_folder.durable import scratch_folder
from risk_sac.scenario.families import density_of
from risk_sac.verdicts.distinct import DistinctFailures

CLASS = re.compile(r"[\w.]+:\w+")  # matches module:Class, which `risk_sac.egos.serve` takes and no campaign


def batch_size(text: str) -> int | str:
    """Returns a batch as a number, or the word as it is."""
    return int(text) if text.isdecimal() else text


# Field of a budget → its flag's type, metavar and help.
BUDGET: Mapping[str, tuple[Callable[[str], object], str, str]] = {
    "episodes": (int, "N", "search episodes of a run (default: 300)"),
    "evaluation_episodes": (int, "N", "episodes of the frozen policy (default: 0)"),
    "cpu_s": (float, "S", "processor time after which a search ends (default: none)"),
    "least_episodes": (int, "N", "search episodes that --cpu-s does not cut off (default: 1)"),
    "batch": (batch_size, "Q", "episodes that are played in parallel, or auto: two per processor (default: 1)"),
}


def add_campaign_flags(parser: Parser, *, families: str, methods: str, seeds: int) -> None:
    """Adds the flags of a campaign; the help names the defaults that are given here."""
    scene, search = parser.group("scene"), parser.group("search")
    named = f"shipped, kept or in a file; `risk-sac scenarios list` (default: {families})"
    scene.add_argument("--scenario", dest="families", nargs="+", metavar="NAME_OR_FILE", help=named)
    search.add_argument(
        "--methods", nargs="+", metavar="NAME", help=f"of {', '.join(named_methods())} (default: {methods})"
    )
    search.add_argument("--seeds", type=int, metavar="N", help=f"number of seeds (default: {seeds})")
    search.add_argument("--first-seed", type=int, metavar="S", help="first of the N seeds (default: 0)")
    add_budget_flags(parser)
    iid = "then play N scenes drawn at random, for bounds (default: none)"
    parser.group("budget").add_argument("--iid", type=int, metavar="N", help=iid)
    parser.group("budget").add_argument("--iid-seed", type=int, metavar="S", help="seed of those scenes (default: 0)")
    search.add_argument("--spec", type=Path, metavar="FILE.yaml", help="settings of a campaign; flags override them")


def add_budget_flags(parser: Parser) -> None:
    """Adds the flags of a run's budget, which a campaign gives to each of its runs."""
    for name, (type_, metavar, what) in BUDGET.items():
        flag = f"--{name.replace('_', '-')}"
        parser.group("budget").add_argument(flag, type=type_, metavar=metavar, help=what)
    every = "refuse story-sweep if its grid has more points than --episodes, instead of playing a stratified sample"
    parser.group("budget").add_argument("--all-points", action="store_true", default=None, help=every)


def budget_flags(options: argparse.Namespace) -> dict[str, Any]:
    """The fields of a budget; None where a flag was not given."""
    return {name: getattr(options, name) for name in (*BUDGET, "all_points")}


def assignment(text: str) -> tuple[str, str]:
    """Splits a NAME=VALUE of `--at`; raises `ConfigError` without an equals sign."""
    name, equals, value = text.partition("=")
    if not equals:
        raise ConfigError("--at", repr(text), "NAME=VALUE")
    return name, value


def add_scene_flags(parser: Parser) -> None:
    """Adds the flags that name the ego and how its adversaries behave."""
    scene = parser.group("scene")
    scene.add_argument("--ego", metavar="EGO", help=f"vehicle under test: {EGO} (default: default)")
    label = "your version of --ego, which `risk-sac trend` compares with others"
    scene.add_argument("--ego-label", metavar="VERSION", help=label)
    behaviours = "|".join(get_args(Behaviour))
    scene.add_argument("--behaviour", metavar=behaviours, help="limits of the adversaries (default: ordinary)")


def named_ego(text: str) -> EgoConfig:
    """Reads the ego that a command line names; see `read_ego`."""
    if CLASS.fullmatch(text) and not Path(text).exists():
        refuse_class(text)
    return read_ego(text)


def scene_flags(options: argparse.Namespace) -> dict[str, Any]:
    """Returns the ego and the behaviour that flags name; None where one is missing."""
    ego = None if options.ego is None else named_ego(options.ego).model_dump(mode="json")
    if options.ego_label is not None:
        if ego is None:
            raise ConfigError("--ego-label", "it without --ego", "both")
        ego |= {"label": options.ego_label}
    return {"ego": ego, "behaviour": options.behaviour}


def add_prior_flag(parser: Parser, earlier: str = "the folder of an earlier run or campaign") -> None:
    """Adds the flag that says what a search starts from; `earlier` is what else it may name."""
    what = f"what a search starts from: shipped, none, or {earlier} (default: shipped)"
    parser.group("search").add_argument("--prior", metavar="PRIOR", help=what)


def campaign_flags(options: argparse.Namespace, seeds: int) -> dict[str, Any]:
    """Fields of a campaign; None where a flag was not given."""
    families = options.families and [kept_name(name) for name in options.families]
    flags = {"families": families, "methods": options.methods} | budget_flags(options)
    return flags | {"seeds": _seeds(options, seeds), "iid": _iid(options), "prior": vars(options).get("prior")}


def _iid(options: argparse.Namespace) -> dict[str, int] | None:
    if options.iid is None:
        if options.iid_seed is not None:
            raise ConfigError("--iid-seed", "it without --iid", "both")
        return None
    return {"episodes": options.iid, "seed": options.iid_seed or 0}


def _seeds(options: argparse.Namespace, default: int) -> list[int] | None:
    if options.seeds is None and options.first_seed is None:
        return None
    count = default if options.seeds is None else options.seeds
    if not 1 <= count <= 100:
        raise ConfigError("seeds", f"{count}", "1 to 100 seeds")
    first = options.first_seed or 0
    return list(range(first, first + count))


MAP_HELP = "a SUMO net, an OSM extract or OpenDRIVE, also packed"


def add_map_flags(parser: Parser, *, several: bool) -> None:
    """Adds the flags of a place; `several`: all places of a pattern can be asked for."""
    add_place_flags(parser, f"in place of a family: {MAP_HELP}", several=several)


def add_place_flags(parser: Parser, what: str, *, several: bool = True) -> None:
    """Adds the flags of a place on the map that `what` describes."""
    group = parser.group("map")
    group.add_argument("--network", metavar="MAP", help=what)
    group.add_argument("--pattern", choices=list(FINDERS), help="pattern that is played on the map")
    group.add_argument("--place", metavar="ID", help="one place; `risk-sac places MAP` lists them")
    if several:
        group.add_argument("--places", choices=["all"], help="every place where the pattern fits")


def families_on_map(options: argparse.Namespace) -> list[str] | None:
    """Adds the places' families to the library; returns their names, or None if no map was named.

    Raises:
      ConfigError: the flags do not go together, or the pattern does not fit there.
      OSError: the map cannot be read, or the library cannot be written.
    """
    flags: Mapping[str, Any] = vars(options)
    if flags.get("network") is None:
        given = [name for name in ("pattern", "place", "places") if flags.get(name) is not None]
        if given:
            raise ConfigError(given[0], "a place without a map", "--network too")
        return None
    for name in ("family", "families"):
        if flags.get(name) is not None:
            raise ConfigError(name, "it beside --network", "one of them", "a place on a map is the family")
    if not Path(options.network).is_file():
        raise ConfigError("network", f"{options.network}, which is no file", "a map")
    if flags.get("pattern") is None:
        raise ConfigError("pattern", "nothing", f"one of {', '.join(FINDERS)}")
    if (flags.get("place") is None) == (flags.get("places") is None):
        got = "nothing" if flags.get("place") is None else "it beside --places"
        raise ConfigError("place", got, "the id of one place", "`risk-sac places MAP` lists them")
    with scratch_folder() as folder:
        chosen = Map(present_net(Path(options.network), folder).file)
        return [chosen.keep(fit) for fit in chosen.fits(options.pattern, options.place)]


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


def _plausibility(worst: Worst) -> PlausibilityClass | None:
    return None if worst.behaviour is None else worst.behaviour.verdict


def _broke(worst: Worst) -> Sequence[str]:
    if isinstance(worst, Violation):
        return worst.broke
    return worst.judgement.broke


FILTERS: Mapping[str, Filter] = {
    "grade": Filter("of this grade", lambda _, worst, wanted: worst.graded == wanted, [*Grade]),
    "plausibility": Filter(
        "as plausible as this", lambda _, worst, wanted: _plausibility(worst) == wanted, [*PlausibilityClass]
    ),
    "severity": Filter("of this severity", lambda _, worst, wanted: _severity(worst) == wanted, [*Severity]),
    "fault": Filter("caused by this party", lambda _, worst, wanted: worst.blamed == wanted, [*Fault]),
    "driven_by": Filter("whose adversaries this drove", lambda each, _, wanted: each.driven_by == wanted, [*DrivenBy]),
    "requirement": Filter(
        "that violate this requirement, such as no_contact", lambda each, _, wanted: wanted in each.failed
    ),
    "broke": Filter(
        "whose striker broke this rule, such as red_light", lambda _, worst, wanted: wanted in _broke(worst)
    ),
    "kind": Filter("of this kind, in the words of the list", lambda _, worst, wanted: worst.kind == wanted),
}


def _gravest(worst: Worst) -> tuple[bool, int, bool, bool]:
    severity = _severity(worst)
    rank = [*Severity].index(severity) if severity else -1
    return not worst.plausible, -rank, not worst.preventable, worst.blamed is not Fault.EGO


WEIGHT = "weight"
SORTS: Mapping[str, Callable[[Worst], Any]] = {"severity": _gravest, "speed": lambda worst: -worst.ego_speed_mps}
SORTED_BY = (
    "found (the order of the search), weight (severity times plausibility, times the scene's density where a "
    "distribution is declared), severity (plausible and worst first) or speed (the fastest ego first)"
)


def add_filter_flags(parser: Parser) -> None:
    """Adds the flags of a list of failures."""
    group = parser.group("choice of failures")
    for name, filter_ in FILTERS.items():
        choices = f": {', '.join(filter_.choices)}" if filter_.choices else ""
        what = f"only those {filter_.what}{choices}"
        flag = f"--{name.replace('_', '-')}"
        group.add_argument(flag, choices=filter_.choices, metavar=name.upper(), help=what)
    group.add_argument(
        "--preventable", dest="grade", action="store_const", const=str(Grade.PREVENTABLE), help="--grade preventable"
    )
    group.add_argument("--distinct", action="store_true", help="only the first of each kind")
    group.add_argument("--raw", action="store_true", help="also those that a validity rule refused")
    orders = ["found", WEIGHT, *SORTS]
    group.add_argument(
        "--sort", choices=orders, metavar="ORDER", default="found", help=f"by {SORTED_BY} (default: found)"
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


def listed(options: argparse.Namespace, failures: Iterable[E], family: FamilyName | None = None) -> list[E]:
    """Returns the failures to list, and notes on standard error if --limit leaves some out.

    Args:
      options: of the command line.
      failures: all of them.
      family: whose declared density weighs them; None: they come in the order of their weight where that is asked for.
    """
    if options.distinct:
        failures = _first_of_each_kind(failures)
    if options.sort == WEIGHT and family is not None:
        density = density_of(family)
        judged = ((-worst.weight(density(each.scene)), each) for each in failures if (worst := each.worst_violation))
        failures = [each for _, each in sorted(judged, key=itemgetter(0))]
    elif options.sort in SORTS:
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
