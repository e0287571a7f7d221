"""Finds junctions where another way crosses or joins the ego's.

The net says which ways cross, by the foe bits of its links.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from risk_sac.maps.cut import signal_of, walk_over
from risk_sac.maps.find_stretch import check_limit
from risk_sac.maps.found import NoFit, Spot, lacking
from risk_sac.maps.ways import AFTER_S, track, way_on
from risk_sac.scenario import junction
from risk_sac.scenario.clearance import ROOM_M, too_near, waits_in_the_way
from risk_sac.scenario.place import JunctionPlace, Leg, Stream, Track
from risk_sac.world.net import Edge, Link, Net, once

ATTACKERS = ("oncoming", "from_left", "from_right")
ONCOMING_RAD, BESIDE_RAD = math.radians(135.0), math.radians(45.0)
ONWARD_S = 8.0  # of driving that an attacker's way goes on behind the junction
FEWEST_ROADS = 2  # that lead to a junction
UNREGULATED = "unregulated"


@dataclass(frozen=True, slots=True)
class Approach:
    """Road to a junction, with the ways on from it.

    They are ordered from left to right, one for each road they lead to.
    """

    edge: Edge
    links: tuple[Link, ...]

    @property
    def driven_rad(self) -> float:
        """Direction in which it reaches the junction."""
        return self.links[0].source.way_out_rad


def spots(net: Net) -> Iterator[Spot]:
    """Every road to a junction that another one leads to as well."""
    for arriving in net.arriving.values():
        if len(arriving) >= FEWEST_ROADS:
            for edge in arriving:
                x, y = edge.drivable[-1].line[-1]
                yield Spot(pattern="junction", id=edge.id, x_m=x, y_m=y)


def place(net: Net, spot: Spot) -> JunctionPlace:
    """Makes a place of the junction at the end of a road.

    Raises:
      NoFit: nothing crosses, or there is too little road.
    """
    edge = net.edges[spot.id]
    at = net.junctions[edge.end]
    own = approach(net, edge)
    ego = leg(net, own, "ego", AFTER_S)
    others = _others(net, own)
    legs, whys = {}, []
    for name, other in others.items():
        try:
            legs[name] = leg(net, other, name, ONWARD_S)
        except NoFit as why:
            whys.append(str(why))
    if not legs and at.type == UNREGULATED:
        raise NoFit(f"the junction {at.id!r} is {UNREGULATED}: no way has priority there; wanted one with rules")
    if not legs and all(link.index is None for link in own.links):
        raise NoFit(f"the net has no lanes inside {at.id!r}, so which ways cross is unknown; wanted internal links")
    if not legs:
        raise NoFit("; ".join(whys) or f"no way across {at.id!r} crosses or joins one of those from {edge.id!r}")
    approaches = {name: other for name, other in others.items() if name in legs} | {"ego": own}
    crossing = next(iter(net.crossings_of.get((at.id, edge.id), ())), None)
    streams = [(name, stream(net, found)) for name, found in approaches.items()]
    return JunctionPlace(
        net="",
        summary=f"Junction {at.id!r} from {edge.id!r}: {_listed([junction.WHO[name] for name in legs])} "
        f"{'crosses or turns' if len(legs) == 1 else 'cross or turn'}"
        f"{', and a pedestrian walks' if crossing is not None else ''}.",
        lanes=len(edge.drivable),
        speed_limit_mps=max(each.speed_limit_mps for each in (ego, *legs.values())),
        lane_width_m=own.links[0].source.width_m,
        signal=signal_of(net, [link.signal for link in own.links]),
        ego=ego,
        others=tuple(legs.values()),
        streams=tuple(Stream(name=f"{name}_road", track=found) for name, found in streams if found is not None),
        walk=None if crossing is None else walk_over(net, crossing, own.driven_rad),
    )


def approach(net: Net, edge: Edge) -> Approach:
    """Finds the ways on from a road, each from its leftmost lane.

    Raises:
      NoFit: the road is a dead end.
    """
    by_target: dict[str, Link] = {}
    for lane in edge.drivable:  # from right to left, so that the leftmost stays
        for link in net.onward.get(lane.id, ()):
            by_target[link.target.edge] = link
    if not by_target:
        raise NoFit(
            f"{edge.id!r} leads nowhere: none of its lanes for cars has a connection at {edge.end!r}, or none that its "
            "signal ever lets anybody take"
        )
    return Approach(edge, tuple(sorted(by_target.values(), key=lambda link: -link.turn_rad)))


def leg(net: Net, road: Approach, name: str, onward_s: float) -> Leg:
    """Finds a vehicle's tracks from a road across the junction.

    Raises:
      NoFit: no way has room.
    """
    tracks, whys = [], []
    check_limit(road.links[0].source)
    limit_mps = road.links[0].source.limit_mps
    for link in road.links:
        try:
            tracks.append(roomy(turn(net, link, onward_s), road.edge.id, junction.room_wanted_m(limit_mps)))
        except NoFit as why:
            whys.append(why)
    if not tracks:
        raise whys[0]
    return Leg(name=name, speed_limit_mps=limit_mps, turns=tuple(tracks))


def roomy(track: Track, edge: str, wanted_m: float) -> Track:
    """The track; raises `NoFit` if it begins too near to its reference."""
    if track.room_m < wanted_m:
        raise NoFit(f"the length of the way in on {edge!r} is {lacking(track.room_m, 'm', wanted_m)}")
    return track


def turn(net: Net, link: Link, onward_s: float) -> Track:
    """The track over a link; raises `NoFit` if something is in the way."""
    found = _turn(net, link, onward_s)
    if isinstance(found, str):
        raise NoFit(found)
    return found


@once
def _turn(net: Net, link: Link, onward_s: float) -> Track | str:
    """The track over a link, or why there is none."""
    if (lane := waits_in_the_way(net, link)) is not None:
        return (
            f"a vehicle that turns from {link.source.edge!r} to {link.target.edge!r} waits in the junction where it "
            f"reaches into {lane.id!r}, the way of those it waits for"
        )
    if (beside := too_near(net, link)) is not None:
        return (
            f"the ways of lanes {link.source.id!r} and {beside.source.id!r} to {link.target.edge!r} come nearer than "
            f"{ROOM_M} m to each other: two cannot drive there beside each other"
        )
    length_m = link.source.length_m
    try:
        way = way_on(net, link.source, onward_s, through=link, from_m=length_m)
    except NoFit as why:
        return str(why)
    return track(net, way, length_m)


def stream(net: Net, road: Approach) -> Track | None:
    """Straight on from the rightmost lane, where a lane is left beside it."""
    if len(road.edge.drivable) < 2:
        return None
    links = net.onward.get(road.edge.drivable[0].id)
    if not links:
        return None
    with suppress(NoFit):
        found = turn(net, min(links, key=lambda link: abs(link.turn_rad)), ONWARD_S)
        return roomy(found, road.edge.id, junction.room_of_a_stream_m())
    return None


def _others(net: Net, own: Approach) -> Mapping[str, Approach]:
    """Finds the roads with a way that is a foe of the ego's.

    Of several from one side it takes the one most square to the ego's.
    """
    best: dict[str, tuple[float, Approach]] = {}
    for edge in net.arriving[own.edge.end]:
        links = [link for lane in edge.drivable for link in net.onward.get(lane.id, ())]
        if edge is own.edge or not any(net.are_foes(one, link) for one in own.links for link in links):
            continue
        other = approach(net, edge)
        name, off_rad = _side(own, other)
        if name not in best or off_rad < best[name][0]:
            best[name] = off_rad, other
    return {name: best[name][1] for name in ATTACKERS if name in best}


def _side(own: Approach, other: Approach) -> tuple[str, float]:
    """From where another road comes, and by how much not quite from there."""
    relative = math.remainder(other.driven_rad - own.driven_rad, math.tau)
    if abs(relative) > ONCOMING_RAD:
        return "oncoming", math.pi - abs(relative)
    if abs(relative) < BESIDE_RAD:  # it joins the ego's road, as a ramp does
        x, y = own.links[0].source.line[-1]
        to_x, to_y = other.links[0].source.line[-1]
        across = (to_y - y) * math.cos(own.driven_rad) - (to_x - x) * math.sin(own.driven_rad)
        return "from_left" if across > 0.0 else "from_right", math.pi / 2 - abs(relative)
    return "from_right" if relative > 0.0 else "from_left", abs(math.pi / 2 - abs(relative))


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
