"""Finds crossings where a vehicle can hide a pedestrian from the ego.

The ego has a lane on its right there. Or there is a lane of oncoming traffic on its left: a vehicle that has just
passed the crossing on it hides a pedestrian from the left. So it is where roads have one lane in each direction.
"""

import math
from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise

from risk_sac.maps.cut import signal_of, walk_over
from risk_sac.maps.find_junction import roomy, turn
from risk_sac.maps.find_stretch import check_limit
from risk_sac.maps.found import NoFit, Spot, lacking
from risk_sac.maps.ways import AFTER_S, track, way_on
from risk_sac.scenario.clearance import truck_reaches
from risk_sac.scenario.family import top_speed
from risk_sac.scenario.hidden_pedestrian import OCCLUDER_M, room_beyond_m, room_wanted_m
from risk_sac.scenario.layout import LEAD_IN_S, TRUCK_LENGTH_M
from risk_sac.scenario.place import CrossingPlace, Site, Track
from risk_sac.world.net import Crossing, Edge, Link, Net, NetLane

OCCLUDED_S = 4.0  # of driving that the way of the occluder goes on
ONWARD_S = 8.0
BESIDE_RAD = math.radians(30.0)  # by which lanes beside each other may not be parallel
MEDIAN_M, SHIFTED_M = 2.0, 6.0  # between them, and from where one ends to where the other begins


def spots(net: Net) -> Iterator[Spot]:
    """Every road that a crossing crosses where it ends."""
    for crossing in net.crossings:
        for id_ in crossing.edges:
            edge = net.edges.get(id_)
            if edge is not None and edge.end == crossing.junction and edge.drivable:
                x, y = edge.drivable[-1].line[-1]
                yield Spot(pattern="crossing", id=id_, x_m=x, y_m=y)


def place(net: Net, spot: Spot) -> CrossingPlace:
    """Makes a place of the crossing at the end of a road.

    Raises:
      NoFit: nothing can hide a pedestrian, or there is no room.
    """
    edge = net.edges[spot.id]
    crossing = net.crossings_of[edge.end, edge.id][0]
    check_limit(edge.drivable[0])
    beyond = len(edge.drivable) < 2
    find = _with_oncoming if beyond else _with_neighbour
    ego_lane, ego, occluder, link = find(net, edge, crossing)
    kind = "signalised" if crossing.signal is not None else "unsignalised"
    hidden = "from behind a vehicle that came the other way" if beyond else "from behind a vehicle in the next lane"
    return CrossingPlace(
        net="",
        summary=f"Crossing {crossing.id!r} of {edge.id!r}, {kind}: a pedestrian steps out {hidden}.",
        lanes=len(edge.drivable),
        speed_limit_mps=ego_lane.limit_mps,
        lane_width_m=ego_lane.width_m,
        signal=signal_of(net, (crossing.signal, link.signal)),
        sites=(
            Site(
                signalised=signal_of(net, (crossing.signal, link.signal)) is not None,
                ego=ego,
                occluder=occluder,
                beyond=beyond,
                oncoming=() if beyond else _oncoming(net, edge.id, crossing.edges),
                walk=walk_over(net, crossing, ego_lane.way_out_rad + (math.pi if beyond else 0.0)),
            ),
        ),
    )


def _with_neighbour(net: Net, edge: Edge, _: Crossing) -> tuple[NetLane, Track, Track, Link]:
    """Finds the leftmost lane for the ego beside a lane for the occluder.

    The occluder is on its right. The ego's lane leads on for an episode and is clear of the occluder's.
    """
    whys = []
    for right, own in reversed(list(pairwise(edge.drivable))):
        try:
            (ego, link), (occluder, beside) = _ego(net, own), _straight(net, right, OCCLUDED_S)
            least_m = TRUCK_LENGTH_M + LEAD_IN_S * top_speed(own.limit_mps) + 1.0
            if occluder.room_m < least_m:
                raise NoFit(f"the length of the way in on the lane beside is {lacking(occluder.room_m, 'm', least_m)}")
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
    """The one lane, and the lane beside it on which others leave the crossing the other way."""
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
    occluder = track(net, way_on(net, beside[0], OCCLUDED_S, from_m=parked_m), 0.0, parked_m)
    if occluder.room_m < room_beyond_m():
        raise NoFit(
            f"the length of the way in of oncoming vehicles is {lacking(occluder.room_m, 'm', room_beyond_m())}"
        )
    return own, ego, occluder, link


def _is_beside(own: NetLane, other: NetLane) -> bool:
    """Whether a lane begins beside the end of another, on its left, and leads back."""
    (x, y), (to_x, to_y) = own.line[-1], other.line[0]
    cos, sin = math.cos(own.way_out_rad), math.sin(own.way_out_rad)
    left_m = (to_y - y) * cos - (to_x - x) * sin
    along_m = (to_x - x) * cos + (to_y - y) * sin
    back = abs(math.remainder(other.way_in_rad - own.way_out_rad, math.tau)) > math.pi - BESIDE_RAD
    return back and 0.0 < left_m <= (own.width_m + other.width_m) / 2 + MEDIAN_M and abs(along_m) <= SHIFTED_M


def _ego(net: Net, own: NetLane) -> tuple[Track, Link]:
    """The ego's track, if there is room, and the link it begins with."""
    found, link = _straight(net, own, AFTER_S)
    return roomy(found, own.edge, room_wanted_m(own.limit_mps)), link


def _straight(net: Net, lane: NetLane, onward_s: float) -> tuple[Track, Link]:
    """The track over the straightest link of a lane that leads on so far, and that link."""
    why = NoFit(f"lane {lane.id!r} leads nowhere, or nowhere that its signal ever lets anybody go")
    for link in sorted(net.onward.get(lane.id, ()), key=lambda link: abs(link.turn_rad)):
        try:
            return turn(net, link, onward_s), link
        except NoFit as error:
            why = error
    raise why


def _oncoming(net: Net, own: str, crossed: tuple[str, ...]) -> tuple[Track, ...]:
    """Over the same crossing the other way: the lanes that lead to the other road that it crosses."""
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
