"""The lanes around the ego's route, as the loaded net has them, and what their signals show."""

from collections.abc import Iterable, Sequence

import libsumo
import numpy as np

from risk_sac.sim.paths import CAR, car_may_use, controlled_links, edge_of, leads_on
from risk_sac.sim.reading import COLOURS
from risk_sac.types import Lane, Road, Signal, StopLine

REACH_M = 600.0  # of the route; no episode drives farther
LEFT, RIGHT = 1, -1
NONE = Signal.NONE  # to look it up in the class takes longer than all else in `signals_at`
SHOWN = COLOURS | {letter.upper(): colour for letter, colour in COLOURS.items()}


def road_around(route: Sequence[str]) -> Road:
    """Returns the road around a route: its lanes, and all lanes of the junctions on it.

    Stop lines are those before the route's lanes: an ego does not see the signals of other directions.
    """
    near = _edges_near(route)
    ids = [id_ for edge in near for id_ in _lanes_of(edge) if car_may_use(id_)]
    links = {id_: [link[4] or link[0] for link in libsumo.lane.getLinks(id_)] for id_ in ids}
    on_route = _on_route(route, ids, links)
    lanes = tuple(_lane(id_, ids, [each for each in links[id_] if each in links], id_ in on_route) for id_ in ids)
    signals = controlled_links()
    stop_lines = tuple(
        StopLine(lane.id, leads_to, *signals[lane.id, leads_to])
        for lane in lanes
        if edge_of(lane.id) in route
        for leads_to in lane.successors
        if (lane.id, leads_to) in signals
    )
    return Road(lanes, stop_lines)


def signals_at(stop_lines: Sequence[StopLine]) -> tuple[Signal, ...]:
    """Returns what the signal of each stop line shows now."""
    signals = {line.signal for line in stop_lines}
    states = {signal: libsumo.trafficlight.getRedYellowGreenState(signal) for signal in signals}
    return tuple([SHOWN.get(states[signal][link], NONE) for _, _, signal, link in stop_lines])


def _edges_near(route: Sequence[str]) -> Iterable[str]:
    """The route's edges, and all edges that meet them at junctions, through the junctions included."""
    found, reached_m = dict.fromkeys(route[:1]), 0.0
    for edge in route:
        if reached_m > REACH_M:
            break
        reached_m += libsumo.lane.getLength(f"{edge}_0")
        for junction in (libsumo.edge.getFromJunction(edge), libsumo.edge.getToJunction(edge)):
            found |= dict.fromkeys(libsumo.junction.getIncomingEdges(junction))
            found |= dict.fromkeys(libsumo.junction.getOutgoingEdges(junction))
    return found


def _lanes_of(edge: str) -> list[str]:
    return [f"{edge}_{i}" for i in range(libsumo.edge.getLaneNumber(edge))]


def _on_route(route: Sequence[str], ids: Sequence[str], links: dict[str, list[str]]) -> set[str]:
    """The lanes that lead on along the route, on its edges and through its junctions."""
    found = {id_ for id_ in ids if edge_of(id_) in route and leads_on(route, id_)}
    for id_ in sorted(found):
        edge = edge_of(id_)
        if edge in route[:-1]:
            following = route[route.index(edge) + 1]
            for via in links[id_]:
                found |= _through(via, following, links)
    return found


def _through(lane: str, following: str, links: dict[str, list[str]]) -> set[str]:
    """Collects the lanes of a way through a junction.

    `lane` is its first one; there are none if the way does not lead to the `following` edge.
    """
    way: set[str] = set()
    while lane in links and lane.startswith(":") and lane not in way:
        way.add(lane)
        lane = next(iter(links[lane]), "")
    return way if edge_of(lane) == following else set()


def _lane(id_: str, ids: Sequence[str], successors: Sequence[str], on_route: bool) -> Lane:
    edge, _, index = id_.rpartition("_")
    left, right = f"{edge}_{int(index) + 1}", f"{edge}_{int(index) - 1}"
    return Lane(
        id=id_,
        line=np.array(libsumo.lane.getShape(id_)).T,
        width_m=libsumo.lane.getWidth(id_),
        limit_mps=libsumo.lane.getMaxSpeed(id_),
        left=left if left in ids else "",
        right=right if right in ids else "",
        may_change_left=left in ids and CAR in libsumo.lane.getChangePermissions(id_, LEFT),
        may_change_right=right in ids and CAR in libsumo.lane.getChangePermissions(id_, RIGHT),
        successors=tuple(successors),
        on_route=on_route,
    )
