"""Finds the places of a map, and keeps them as scenarios."""

from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from types import ModuleType

from risk_sac.errors import MapError
from risk_sac.maps import find_crossing, find_junction, find_stretch
from risk_sac.maps.cut import cut
from risk_sac.maps.found import Fit, Misfit, NoFit, Pattern, Spot, Survey
from risk_sac.maps.scenarios import NET
from risk_sac.maps.ways import check_lengths
from risk_sac.scenario import library
from risk_sac.world.net import Net
from risk_sac.world.read_net import read_net, read_tree

FINDERS: dict[Pattern, ModuleType] = {
    "car_following": find_stretch,
    "crossing": find_crossing,
    "junction": find_junction,
}
CANDIDATES: dict[Pattern, str] = {  # what their spots are
    "car_following": f"road for cars of {find_stretch.SHORTEST_M:g} m or more",
    "crossing": "road for cars that ends at a crossing",
    "junction": "road to a junction that another one leads to as well",
}


def survey(
    net: Net, patterns: Collection[Pattern] = tuple(FINDERS), tell: Callable[[float], None] = lambda share: None
) -> Survey:
    """All places where patterns fit, and why elsewhere they do not.

    Args:
      net: where.
      patterns: which.
      tell: called with the share of spots that was looked at.
    """
    fits, misfits = [], []
    spots = list(_spots(net, patterns))
    for number, spot in enumerate(spots):
        tell(number / len(spots))
        try:
            fits.append(_fit(net, spot))
        except NoFit as error:
            misfits.append(Misfit(spot, str(error)))
    found = {spot.pattern for spot in spots}
    nowhere = {pattern: _no_spot(net, pattern) for pattern in patterns if pattern not in found}
    return Survey(tuple(fits), tuple(misfits), nowhere)


def place_at(net: Net, pattern: Pattern, id_: str) -> Fit:
    """Makes the place of a pattern at a spot.

    Raises:
      MapError: the map has no such spot, or the pattern does not fit there.
    """
    spot = next((spot for spot in _spots(net, (pattern,)) if spot.id == id_), None)
    if spot is None:
        raise MapError("place", _nowhere(net, pattern, id_))
    try:
        return _fit(net, spot)
    except NoFit as error:
        raise MapError("place", f"{pattern} does not fit at {id_!r}: {error}") from error


def _spots(net: Net, patterns: Collection[Pattern]) -> Iterator[Spot]:
    for pattern in patterns:
        yield from FINDERS[pattern].spots(net)


def _fit(net: Net, spot: Spot) -> Fit:
    """Makes the place of a spot; raises `NoFit` where there is none."""
    fit: Fit = FINDERS[spot.pattern].fit(net, spot)
    check_lengths(net, fit.tracks)
    return fit


def _no_spot(net: Net, pattern: Pattern) -> str:
    if pattern == "crossing" and not net.crossings:
        return "the net has no crossing; netconvert drops those that join no sidewalks, and warns of it"
    return f"the net has no {CANDIDATES[pattern]}"


def _nowhere(net: Net, pattern: Pattern, id_: str) -> str:
    if id_ not in net.edges:
        return f"the map has no edge {id_!r}; a place is named by the edge that leads to it, or on which it is"
    return f"{pattern} does not fit at {id_!r}: wanted a {CANDIDATES[pattern]}"


class Map:
    """A net, read once."""

    def __init__(self, file: Path) -> None:
        """Reads it; raises `MapError` if no pattern could be placed on it."""
        self._root = read_tree(file)
        self.net: Net = read_net(file, self._root)

    def fits(self, pattern: Pattern, place: str | None) -> Sequence[Fit]:
        """Makes one place, or all places that a pattern fits.

        Raises:
          MapError: it does not fit at the one, or nowhere.
        """
        if place is not None:
            return [place_at(self.net, pattern, place)]
        places = survey(self.net, (pattern,))
        if not places.fits:
            why = places.nowhere.get(pattern) or f"at {places.misfits[0].spot.id!r}, {places.misfits[0].why}"
            raise MapError("places", f"{pattern} fits nowhere on this map: {why}")
        return places.fits

    def keep(self, fit: Fit) -> str:
        """Puts a place into the library; returns the name of its family."""
        return library.keep(fit.scenario, {NET: cut(self.net, self._root, fit)})
