"""Finds the places of a map, and keeps them as scenarios."""

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

from risk_sac.errors import MapError
from risk_sac.maps import found as parts
from risk_sac.maps import ways
from risk_sac.maps.find_junction import fit_junction, junction_spots, roomy, turn
from risk_sac.maps.found import NET, Fields, Fit, Misfit, NoFit, Pattern, Spot, Survey
from risk_sac.scenario import library
from risk_sac.scenario.ground import truck_reaches
from risk_sac.scenario.lane_places import Track
from risk_sac.scenario.layout import LEAD_IN_S, TRUCK_LENGTH_M
from risk_sac.world.net import Crossing, Edge, Link, Net, NetLane
from risk_sac.world.read_net import read_net, read_tree

NEAREST_M, FARTHEST_M = 25.0, 90.0  # range of the ego's distance from the crossing
FOLLOWING_M = 25.0  # distance from the ego's front to its follower's
OCCLUDER_MPS = 12.0
NEXT_M, OCCLUDER_M = 0.5, 25.0  # range of the occluder's distance from the crossing
ONCOMING, ONCOMING_MPS = 4, 10.0
ONCOMING_M, SPACING_M = 60.0, 30.0  # distance of the first oncoming vehicle from the crossing, and between them
ROOM_BEYOND_M = LEAD_IN_S * OCCLUDER_MPS + TRUCK_LENGTH_M  # least room before a crossing for an oncoming occluder
OCCLUDED_S = 4.0  # of driving that the way of the occluder goes on
ONWARD_S = 8.0
BESIDE_RAD = math.radians(30.0)  # by which lanes beside each other may not be parallel
MEDIAN_M, SHIFTED_M = 2.0, 6.0  # between them, and from where one ends to where the other begins


def crossing_spots(net: Net) -> Iterator[Spot]:
    """Every road that a crossing crosses where it ends."""
    for crossing in net.crossings:
        for id_ in crossing.edges:
            edge = net.edges.get(id_)
            if edge is not None and edge.end == crossing.junction and edge.drivable:
                x, y = edge.drivable[-1].line[-1]
                yield Spot(pattern="crossing", id=id_, x_m=x, y_m=y)


def fit_crossing(net: Net, spot: Spot) -> Fit:
    """Writes a crossing's scenario; raises `NoFit` without cover or room."""
    edge = net.edges[spot.id]
    crossing = net.crossings_of[edge.end, edge.id][0]
    ways.check_limit(edge.drivable[0])
    beyond = len(edge.drivable) < 2
    find = _with_oncoming if beyond else _with_neighbour
    own, ego, occluder, link = find(net, edge, crossing)
    offset, signal = parts.signal_parts(net, (crossing.signal, link.signal))
    oncoming = () if beyond else _oncoming(net, edge.id, crossing.edges)
    if beyond:
        start: Fields = {"lane": parts.lane_of(net, occluder), "at_m": f"occluder_distance_m + {TRUCK_LENGTH_M:g}"}
    else:
        start = _before(net, occluder, "occluder_distance_m")
    fields = {
        "parameters": _parameters(own, ego, occluder, beyond=beyond) | offset | parts.friction(),
        "ego": {
            "start": _before(net, ego, "ego_distance_m"),
            "speed": "ego_speed_mps",
            "route": parts.route_of(net, ego),
        },
        "actors": {
            "occluder": {
                "body": "truck",
                "start": start,
                "speed": "occluder_speed_mps",
                "route": parts.route_of(net, occluder),
            },
            "pedestrian": parts.pedestrian(edge.id, "left" if beyond else "right"),
            "follower": {
                "role": "background",
                "start": {"beside": "ego", "ahead_m": -FOLLOWING_M},
                "speed": "ego_speed_mps",
            },
        },
        "streams": _streams(net, oncoming),
        **signal,
    }
    kind = "signalised" if crossing.signal is not None else "unsignalised"
    hidden = "from behind a vehicle that came the other way" if beyond else "from behind a vehicle in the next lane"
    summary = f"Crossing {crossing.id!r} of {edge.id!r}, {kind}: a pedestrian steps out {hidden}."
    actors = {name: name for name in ("occluder", "pedestrian")}
    like = {"family": "mixed", "actors": actors, "mirrored": beyond}  # whose pedestrian comes from the right
    scenario = parts.scenario_of(spot, summary, ["iso34502:pedestrian"], like, fields)
    return Fit(spot, scenario, (ego, occluder, *oncoming))


def _parameters(own: NetLane, ego: Track, occluder: Track, *, beyond: bool) -> Fields:
    lead_m = LEAD_IN_S * parts.top_speed(own.limit_mps)
    ego_m = parts.at_most(FARTHEST_M, ego.room_m - FOLLOWING_M - TRUCK_LENGTH_M - lead_m)
    if beyond:
        last, meaning = occluder.pieces[-1], "crossing's far edge to the occluder's rear"
        occluder_m = parts.at_most(OCCLUDER_M, last.length_m - last.reach_m - TRUCK_LENGTH_M)
    else:
        meaning = "occluder's front to the crossing's near edge"
        occluder_m = parts.at_most(OCCLUDER_M, occluder.room_m - TRUCK_LENGTH_M - lead_m)
    return {
        **parts.initial_speed("ego_speed_mps", 6, own.limit_mps, "initial speed of the ego"),
        "ego_distance_m": parts.number((NEAREST_M, ego_m), "m", "ego's front to the crossing's near edge"),
        "occluder_distance_m": parts.number((NEXT_M, occluder_m), "m", meaning),
        **parts.initial_speed(
            "occluder_speed_mps", 0, min(OCCLUDER_MPS, own.limit_mps), "initial speed of the occluder"
        ),
        **parts.walking("pedestrian along the road from the crossing's axis"),
    }


def _before(net: Net, way: Track, distance_m: str) -> Fields:
    return {"lane": parts.lane_of(net, way), "before": "crossing", "distance_m": distance_m}


def _streams(net: Net, oncoming: Sequence[Track]) -> Fields:
    streams, gap_m = {}, SPACING_M * len(oncoming)
    for i, (name, way) in enumerate(zip(("oncoming", "oncoming_beside"), oncoming, strict=False)):
        first_m = ONCOMING_M + SPACING_M * i
        starts_m = [first_m + gap_m * k for k in range(ONCOMING // len(oncoming))]
        if count := sum(start_m + TRUCK_LENGTH_M <= way.room_m for start_m in starts_m):
            streams[name] = {
                "lane": parts.lane_of(net, way),
                "from_m": first_m - gap_m,
                "gap_m": gap_m,
                "count": count,
                "speed": ONCOMING_MPS,
                "lead_in": False,
                "route": parts.route_of(net, way),
            }
    return streams


def _room_wanted_m(limit_mps: float) -> float:
    """Least room before a crossing on the ego's track."""
    return NEAREST_M + FOLLOWING_M + TRUCK_LENGTH_M + LEAD_IN_S * parts.top_speed(limit_mps)


def _with_neighbour(net: Net, edge: Edge, _: Crossing) -> tuple[NetLane, Track, Track, Link]:
    """Finds the ego's lane, beside and clear of the occluder's.

    It is the leftmost one that leads on for an episode.
    """
    whys = []
    for right, own in reversed(list(pairwise(edge.drivable))):
        try:
            (ego, link), (occluder, beside) = _ego(net, own), _straight(net, right, OCCLUDED_S)
            least_m = TRUCK_LENGTH_M + LEAD_IN_S * parts.top_speed(own.limit_mps) + 1.0
            if occluder.room_m < least_m:
                raise NoFit(
                    f"the length of the way in on the lane beside is {parts.lacking(occluder.room_m, 'm', least_m)}"
                )
            if truck_reaches(net, beside, link):
                raise NoFit(
                    f"a truck that drives on from {right.id!r} reaches into the way of a vehicle that drives on from "
                    f"{own.id!r}"
                )
            return own, ego, occluder, link
        except NoFit as why:
            whys.append(why)
    raise whys[0]


def _with_oncoming(net: Net, edge: Edge, crossing: Crossing) -> tuple[NetLane, Track, Track, Link]:
    """Returns the only lane, the ego's and oncoming tracks, and the link."""
    (own,) = edge.drivable
    lanes = [net.edges[id_].drivable[-1] for id_ in crossing.edges if id_ in net.edges and net.edges[id_].drivable]
    beside = [lane for lane in lanes if net.edges[lane.edge].start == edge.end and _is_beside(own, lane)]
    if not beside:
        raise NoFit(
            f"{edge.id!r} has 1 lane for cars, and none beside it for oncoming vehicles; wanted one of the two, "
            "so that a vehicle can hide the pedestrian"
        )
    ego, link = _ego(net, own)
    parked_m = TRUCK_LENGTH_M + OCCLUDER_M
    occluder = ways.track(net, ways.way_on(net, beside[0], OCCLUDED_S, from_m=parked_m), 0.0, parked_m)
    if occluder.room_m < ROOM_BEYOND_M:
        raise NoFit(
            f"the length of the way in of oncoming vehicles is {parts.lacking(occluder.room_m, 'm', ROOM_BEYOND_M)}"
        )
    return own, ego, occluder, link


def _is_beside(own: NetLane, other: NetLane) -> bool:
    """Whether a lane begins left of another's end and leads back."""
    (x, y), (to_x, to_y) = own.line[-1], other.line[0]
    cos, sin = math.cos(own.way_out_rad), math.sin(own.way_out_rad)
    left_m = (to_y - y) * cos - (to_x - x) * sin
    along_m = (to_x - x) * cos + (to_y - y) * sin
    back = abs(math.remainder(other.way_in_rad - own.way_out_rad, math.tau)) > math.pi - BESIDE_RAD
    return back and 0.0 < left_m <= (own.width_m + other.width_m) / 2 + MEDIAN_M and abs(along_m) <= SHIFTED_M


def _ego(net: Net, own: NetLane) -> tuple[Track, Link]:
    """Returns the ego's track and first link; raises `NoFit` without room."""
    found, link = _straight(net, own, ways.AFTER_S)
    return roomy(found, own.edge, _room_wanted_m(own.limit_mps)), link


def _straight(net: Net, lane: NetLane, onward_s: float) -> tuple[Track, Link]:
    """Returns the straightest long enough track from a lane, and its link."""
    why = NoFit(f"lane {lane.id!r} leads nowhere, or nowhere that its signal ever lets anybody go")
    for link in sorted(net.onward.get(lane.id, ()), key=lambda link: abs(link.turn_rad)):
        try:
            return turn(net, link, onward_s), link
        except NoFit as error:
            why = error
    raise why


def _oncoming(net: Net, own: str, crossed: tuple[str, ...]) -> tuple[Track, ...]:
    """Returns opposite tracks over a crossing, to the other road it crosses."""
    links = [
        link
        for id_ in crossed
        if id_ in net.edges and id_ != own
        for lane in net.edges[id_].drivable
        for link in net.back.get(lane.id, ())
        if abs(link.turn_rad) < 0.8
    ]
    tracks = []
    for link in links:
        with suppress(NoFit):
            tracks.append(turn(net, link, ONWARD_S))
    return tuple(tracks[:2])


FINDERS: dict[Pattern, tuple[Callable[[Net], Iterator[Spot]], Callable[[Net, Spot], Fit]]] = {
    "car_following": (ways.stretch_spots, ways.fit_stretch),
    "crossing": (crossing_spots, fit_crossing),
    "junction": (junction_spots, fit_junction),
}
CANDIDATES: dict[Pattern, str] = {  # what their spots are
    "car_following": f"road for cars of {ways.SHORTEST_M:g} m or more",
    "crossing": "road for cars that ends at a crossing",
    "junction": "road to a junction that another one leads to as well",
}


def survey(
    net: Net, patterns: Collection[Pattern] = tuple(FINDERS), tell: Callable[[float], None] = lambda share: None
) -> Survey:
    """Finds all places where patterns fit, and why elsewhere not.

    `tell` gets the share of the map that was searched.
    """
    fits, misfits = [], []
    spots = list(_spots(net, patterns))
    for done, spot in enumerate(spots):
        tell(done / len(spots))
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
        yield from FINDERS[pattern][0](net)


def _fit(net: Net, spot: Spot) -> Fit:
    fit = FINDERS[spot.pattern][1](net, spot)
    ways.check_lengths(net, fit.tracks)
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
        """Makes one place, or all that a pattern fits.

        Raises:
          MapError: the pattern does not fit there, or fits nowhere.
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
        return library.keep(fit.scenario, {NET: parts.cut(self.net, self._root, fit)})
