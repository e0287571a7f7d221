"""Where on a net a pedestrian may be hidden: at a crossing before which the ego has a lane on its right."""

from collections.abc import Iterator
from itertools import pairwise

from risk_sac.scenario.family import LEAD_IN_S, top_speed
from risk_sac.scenario.hidden_pedestrian import BODY_M, room_wanted_m
from risk_sac.scenario.maps.around import signal_of, walk_over
from risk_sac.scenario.maps.find_junction import turn
from risk_sac.scenario.maps.find_stretch import check_limit
from risk_sac.scenario.maps.found import NoFit, Spot
from risk_sac.scenario.maps.net import Lane, Link, Net
from risk_sac.scenario.maps.ways import AFTER_S
from risk_sac.scenario.place import CrossingPlace, Site, Track

OCCLUDED_S = 4.0  # of driving that the way of who hides the pedestrian goes on
ONWARD_S = 8.0


def spots(net: Net) -> Iterator[Spot]:
    """Every road that a crossing crosses where it ends."""
    for crossing in net.crossings:
        for id_ in crossing.edges:
            edge = net.edges.get(id_)
            if edge is not None and edge.end == crossing.junction and edge.drivable:
                x, y = edge.drivable[-1].line[-1]
                yield Spot(pattern="crossing", id=id_, x_m=x, y_m=y)


def place(net: Net, spot: Spot) -> CrossingPlace:
    """The crossing at the end of a road.

    Raises:
      NoFit: nothing could hide a pedestrian there, or there is no room to come from or to go on to.
    """
    edge = net.edges[spot.id]
    crossing = net.crossings_of[edge.end, edge.id][0]
    if len(edge.drivable) < 2:
        raise NoFit(f"{edge.id!r} has 1 lane for cars; wanted 2, so that a vehicle can hide the pedestrian")
    check_limit(edge.drivable[0])
    ego_lane, ego, occluder, link = _lanes(net, edge.drivable)
    kind = "signalised" if crossing.signal is not None else "unsignalised"
    return CrossingPlace(
        net="",
        summary=f"Crossing {crossing.id!r} of {edge.id!r}, {kind}: a pedestrian steps out from behind a vehicle in the "
        "adjacent lane.",
        lanes=len(edge.drivable),
        speed_limit_mps=ego_lane.limit_mps,
        lane_width_m=ego_lane.width_m,
        signal=signal_of(net, (crossing.signal, link.signal)),
        sites=(
            Site(
                signalised=signal_of(net, (crossing.signal, link.signal)) is not None,
                ego=ego,
                occluder=occluder,
                oncoming=_oncoming(net, edge.id, crossing.edges),
                walk=walk_over(net, crossing, ego_lane.way_out_rad),
            ),
        ),
    )


def _lanes(net: Net, lanes: tuple[Lane, ...]) -> tuple[Lane, Track, Track, Link]:
    """The leftmost lane that leads on for an episode and has one to its right that leads anywhere."""
    why = ""
    for right, own in reversed(list(pairwise(lanes))):
        ego, because = _straight(net, own, AFTER_S)
        occluder, hidden_because = _straight(net, right, OCCLUDED_S)
        if ego is None or occluder is None:
            why = why or because or hidden_because
            continue
        wanted_m = room_wanted_m(own.limit_mps)
        least_m = BODY_M + LEAD_IN_S * top_speed(own.limit_mps) + 1.0
        if ego.room_m < wanted_m:
            why = why or f"{own.edge!r} can be come from for {ego.room_m:.0f} m; wanted {wanted_m:.0f} m"
        elif occluder.room_m < least_m:
            why = why or f"the lane beside can be come from for {occluder.room_m:.0f} m; wanted {least_m:.0f} m"
        else:
            return own, ego, occluder, net.onward[own.id][0]
    raise NoFit(why)


def _straight(net: Net, lane: Lane, onward_s: float) -> tuple[Track | None, str]:
    """The track over the straightest link of a lane that leads on so far."""
    why = f"lane {lane.id!r} leads nowhere"
    for link in sorted(net.onward.get(lane.id, ()), key=lambda link: abs(link.turn_rad)):
        found = turn(net, link, onward_s)
        if isinstance(found, Track):
            return found, ""
        why = found
    return None, why


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
    found = [turn(net, link, ONWARD_S) for link in links]
    return tuple(each for each in found if isinstance(each, Track))[:2]
