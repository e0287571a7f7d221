"""Flags that describe a campaign or a run, and those that name places of a map."""

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from risk_sac.cli.console import EGO
from risk_sac.cli.parser import Parser
from risk_sac.config import METHODS, EgoConfig
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.registry import refuse_class
from risk_sac.errors import ConfigError
from risk_sac.run_folder.scratch import scratch_folder
from risk_sac.scenario.maps.convert import present_net
from risk_sac.scenario.maps.finder import FINDERS, Map

CLASS = re.compile(r"[\w.]+:\w+")  # module:Class, which `risk_sac.egos.serve` takes and no campaign
# Field of a budget → its flag's type, metavar and help.
BUDGET: Mapping[str, tuple[type, str, str]] = {
    "episodes": (int, "N", "search episodes of a run (default: 300)"),
    "evaluation_episodes": (int, "N", "episodes of the frozen policy (default: 0)"),
    "cpu_s": (float, "S", "processor time after which a search ends (default: none)"),
    "least_episodes": (int, "N", "search episodes that --cpu-s does not cut off (default: 1)"),
}


def add_campaign_flags(parser: Parser, *, families: str, methods: str, seeds: int) -> None:
    """Adds the flags of a campaign; the help names the defaults that are given here."""
    scene, search = parser.group("scene"), parser.group("search")
    scene.add_argument("--families", nargs="+", metavar="FAMILY", help=f"of low, mixed, dense (default: {families})")
    search.add_argument("--methods", nargs="+", metavar="NAME", help=f"of {', '.join(METHODS)} (default: {methods})")
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


def budget_flags(options: argparse.Namespace) -> dict[str, Any]:
    """The fields of a budget; None where a flag was not given."""
    return {name: getattr(options, name) for name in BUDGET}


def add_ego_flag(parser: Parser) -> None:
    """Adds the flag that names the ego."""
    parser.group("scene").add_argument("--ego", metavar="EGO", help=f"vehicle under test: {EGO} (default: default)")


def named_ego(text: str) -> EgoConfig:
    """Reads the ego that a command line names; see `read_ego`."""
    if CLASS.fullmatch(text) and not Path(text).exists():
        refuse_class(text)
    return read_ego(text)


def ego_flag(options: argparse.Namespace) -> dict[str, Any]:
    """The ego of a run or a campaign; None where the flag was not given."""
    return {"ego": None if options.ego is None else named_ego(options.ego).model_dump(mode="json")}


def add_prior_flag(parser: Parser, earlier: str = "the folder of an earlier run or campaign") -> None:
    """Adds the flag that says what a search starts from; `earlier` is what else it may name."""
    what = f"what a search starts from: shipped, none, or {earlier} (default: shipped)"
    parser.group("search").add_argument("--prior", metavar="PRIOR", help=what)


def campaign_flags(options: argparse.Namespace, seeds: int) -> dict[str, Any]:
    """Fields of a campaign; None where a flag was not given."""
    flags = {"families": options.families, "methods": options.methods} | budget_flags(options)
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
    if flags.get("pattern") is None:
        raise ConfigError("pattern", "nothing", f"one of {', '.join(FINDERS)}")
    if (flags.get("place") is None) == (flags.get("places") is None):
        raise ConfigError("place", "nothing, or places too", "the id of one", "`risk-sac places MAP` lists them")
    with scratch_folder() as folder:
        chosen = Map(present_net(Path(options.network), folder).file)
        return [chosen.keep(fit) for fit in chosen.fits(options.pattern, options.place)]
