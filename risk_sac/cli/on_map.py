"""Flags that name places of a map, and the families that they are."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from risk_sac.errors import ConfigError
from risk_sac.scenario.maps.convert import present_net
from risk_sac.scenario.maps.finder import FINDERS
from risk_sac.scenario.maps.keep import Map

MAP_HELP = "a SUMO net, an OSM extract or OpenDRIVE, also gzipped"


def add_map_flags(parser: argparse.ArgumentParser, *, several: bool) -> None:
    """Adds the flags.

    Args:
      parser: of the command.
      several: whether all places of a pattern can be asked for.
    """
    parser.add_argument("--network", type=Path, metavar="MAP", help=f"in place of a family: {MAP_HELP}")
    parser.add_argument("--pattern", choices=list(FINDERS), help="what is played on the map")
    parser.add_argument("--place", metavar="ID", help="where; `risk-sac places MAP` lists them")
    if several:
        parser.add_argument("--places", choices=["all"], help="wherever the pattern fits")


def families_on_map(options: argparse.Namespace) -> list[str] | None:
    """The names of the places' families, which are in the library from now on; None: no map was named.

    Raises:
      ConfigError: the flags do not go together, or the pattern does not fit there.
      OSError: the map cannot be read, or the library cannot be written.
    """
    flags: Mapping[str, Any] = vars(options)
    if flags.get("network") is None:
        given = [name for name in ("pattern", "place", "places") if flags.get(name) is not None]
        if given:
            raise ConfigError("it says where on a map; wanted --network too", field=given[0])
        return None
    if flags.get("pattern") is None:
        raise ConfigError(f"wanted one of {', '.join(FINDERS)}", field="pattern")
    if (flags.get("place") is None) == (flags.get("places") is None):
        raise ConfigError("wanted the id of one; `risk-sac places MAP` lists them", field="place")
    with TemporaryDirectory() as folder:
        chosen = Map(present_net(options.network, Path(folder)).file)
        return [chosen.keep(fit) for fit in chosen.fits(options.pattern, options.place)]
