"""Flags of campaigns, runs, egos, places and lists, and named scenarios."""

import argparse
import re
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from risk_sac.cli.console import EGO, number
from risk_sac.cli.parser import Parser
from risk_sac.config import Behaviour, EgoConfig, Scenario
from risk_sac.config.methods import named_methods
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.registry import refuse_class
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.host.terminal import complain
from risk_sac.maps.convert import present_net
from risk_sac.maps.finder import FINDERS, Map
from risk_sac.run_folder.durable import scratch_folder
from risk_sac.scenario import library
from risk_sac.scenario.check import check_document
from risk_sac.scenario.reading import nets_of, read_document, shipped_document, shipped_names

if TYPE_CHECKING:
    from risk_sac.openscenario.scenario_file import Imported

OPENSCENARIO = ".xosc"
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
    """Adds a campaign's flags; the help names the given defaults."""
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
    """Adds the flags of one run's budget, also for campaigns' runs."""
    for name, (type_, metavar, what) in BUDGET.items():
        flag = f"--{name.replace('_', '-')}"
        parser.group("budget").add_argument(flag, type=type_, metavar=metavar, help=what)
    every = "refuse story-sweep if its grid has more points than --episodes, instead of playing a stratified sample"
    parser.group("budget").add_argument("--all-points", action="store_true", default=None, help=every)


def budget_flags(options: argparse.Namespace) -> dict[str, Any]:
    """The fields of a budget; None where a flag was not given."""
    return {name: getattr(options, name) for name in (*BUDGET, "all_points")}


def assignment(text: str) -> tuple[str, str]:
    """Splits a NAME=VALUE of `--at`.

    Raises:
      ConfigError: it has no equals sign.
    """
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
    """Returns the ego and behaviour of flags; None for missing ones."""
    ego = None if options.ego is None else named_ego(options.ego).model_dump(mode="json")
    if options.ego_label is not None:
        if ego is None:
            raise ConfigError("--ego-label", "it without --ego", "both")
        ego |= {"label": options.ego_label}
    return {"ego": ego, "behaviour": options.behaviour}


def add_prior_flag(parser: Parser, earlier: str = "the folder of an earlier run or campaign") -> None:
    """Adds the flag for a search's start; `earlier` is another possible value."""
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
    """Adds a place's flags; `several` allows all places of a pattern."""
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
    """Adds places' families to the library; returns names, None without a map.

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


LIMIT = 20


def add_limit(parser: Parser) -> None:
    """Adds the flag that bounds a list."""
    least = number(int, 1)
    parser.group("output").add_argument(
        "--limit", type=least, default=LIMIT, metavar="N", help="at most (default: %(default)s)"
    )


def kept_name(name_or_file: str) -> str:
    """Returns a scenario's name; documents and OpenSCENARIO files enter the library.

    Raises:
      ConfigError: the document has a fault, or there is none.
    """
    if not is_file(name_or_file):
        return name_or_file
    if Path(name_or_file).suffix.lower() == OPENSCENARIO:
        return keep_imported(imported_file(Path(name_or_file)))
    try:
        document, folder = document_at(name_or_file)
        nets = nets_of(document, folder)
        check_document(document, nets)
    except ConfigError as error:
        for fault in (error, *error.others):
            fault.field = f"{name_or_file}: {fault.field}".removesuffix(": ")
        raise
    return library.keep(document, library.own_files(document, nets))


def imported_file(file: Path, ego: str | None = None) -> "Imported":
    """Imports an OpenSCENARIO file, and says what differs from it."""
    from risk_sac.openscenario.scenario_file import import_scenario  # imported here: few commands need it

    imported = import_scenario(file, ego=ego)
    origin = imported.document.origin
    for remark in origin.remarks if origin is not None else ():
        complain(f"warning: {remark}")
    return imported


def keep_imported(imported: "Imported") -> str:
    """Checks an imported scenario, adds it to the library, returns its name."""
    with tempfile.TemporaryDirectory() as folder:
        for name, content in imported.files.items():
            Path(folder, name).write_bytes(content)
        try:
            check_document(imported.document, nets_of(imported.document, Path(folder)))
        except ConfigError as error:
            raise imported.located(error) from error
    return library.keep(imported.document, imported.files)


def document_at(name_or_file: str) -> tuple[Scenario, Path | None]:
    """Returns a scenario's document, and its own nets' folder or None.

    Raises:
      ConfigError: there is no such scenario or file, or the document has a fault.
    """
    if is_file(name_or_file) and Path(name_or_file).suffix.lower() == OPENSCENARIO:
        return library.kept(kept_name(name_or_file))
    if is_file(name_or_file):
        return read_document(Path(name_or_file)), Path(name_or_file).absolute().parent
    if name_or_file in shipped_names():
        return shipped_document(name_or_file), None
    try:
        return library.kept(name_or_file)
    except ConfigError as error:
        known = library.listed()
        close = next((name for name in known if name.startswith(f"{name_or_file}_")), name_or_file)
        remedy = did_you_mean(close, (*shipped_names(), *known)) or error.remedy
        raise ConfigError("scenario", error.got, error.expected, remedy) from None


def is_file(name_or_file: str) -> bool:
    """Whether a word names a file: it has a folder or ending."""
    if Path(name_or_file).suffix or "/" in name_or_file:
        if not Path(name_or_file).is_file():
            remedy = "check its path, or name a scenario of `risk-sac scenarios list`"
            raise ConfigError("scenario", f"{name_or_file}, which is no file", "a document", remedy)
        return True
    return False
