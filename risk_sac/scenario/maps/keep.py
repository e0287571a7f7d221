"""From a map and a place's name to a family."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

from risk_sac.scenario import library
from risk_sac.scenario.maps.cut import cut, read_tree
from risk_sac.scenario.maps.finder import place_at, survey, with_ground
from risk_sac.scenario.maps.found import Fit, Pattern
from risk_sac.scenario.maps.net import Net, read_net


class Map:
    """A net, read once."""

    def __init__(self, file: Path) -> None:
        """Reads it.

        Raises:
          MapError: no pattern could be placed on it; the message says why.
          OSError: it cannot be read.
        """
        self.net: Net = read_net(file)
        self._root: ET.Element = read_tree(file)

    def fits(self, pattern: Pattern, place: str | None) -> Sequence[Fit]:
        """One place, or all at which a pattern fits.

        Raises:
          MapError: it does not fit there.
        """
        return [place_at(self.net, pattern, place)] if place is not None else survey(self.net, (pattern,)).fits

    def keep(self, fit: Fit) -> str:
        """Puts a place into the library; returns the name of the family that it is.

        Raises:
          OSError: the library cannot be written.
        """
        fit = with_ground(self.net, fit)
        return library.keep(fit.place, cut(self.net, self._root, fit))
