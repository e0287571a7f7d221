"""Finds junctions where another way crosses or joins the ego's.

The net says which ways cross, by the foe bits of its links.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from risk_sac.maps import found as parts
from risk_sac.maps.found import Fields, Fit, NoFit, Spot
from risk_sac.maps.ways import AFTER_S, check_limit, track, way_on
from risk_sac.scenario.families import MOST_OVER_LIMIT
from risk_sac.scenario.ground import ROOM_M, too_near, waits_in_the_way
from risk_sac.scenario.lane_places import STRAIGHT_RAD, Track
from risk_sac.scenario.layout import CAR_LENGTH_M, LEAD_IN_S
from risk_sac.world.net import Edge, Link, Net, once

NEAREST_M, FARTHEST_M = 10.0, 90.0  # range of the distance of attacker and ego from the stop line
LEAST_RANGE_M = 10.0  # least range of those distances at a place
STREAM_MPS, STREAM_M = 9.0, 30.0
WIDEST_GAP_M = 40.0  # widest gap between background vehicles
STREAM_ROOM_M = STREAM_M + 2 * WIDEST_GAP_M + CAR_LENGTH_M + LEAD_IN_S * STREAM_MPS  # least before the stop line
WHO = {
    "ego": "the ego",
    "oncoming": "the oncoming vehicle",
    "from_left": "the vehicle from the left",
    "from_right": "the vehicle from the right",
}
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


def junction_spots(net: Net) -> Iterator[Spot]:
    """Every road to a junction that another one leads to as well."""
    for arriving in net.arriving.values():
        if len(arriving) >= FEWEST_ROADS:
            for edge in arriving:
                x, y = edge.drivable[-1].line[-1]
                yield Spot(pattern="junction", id=edge.id, x_m=x, y_m=y)


def fit_junction(net: Net, spot: Spot) -> Fit:
    """Writes the scenario of the junction at a road's end.

    Raises:
      NoFit: nothing crosses there, or there is no room.
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
    ways = {f"{name}_road": stream(net, other) for name, other in approaches.items()}
    streams = {name: way for name, way in ways.items() if way is not None}
    walked = (at.id, edge.id) in net.crossings_of
    fields = _fields(net, own, (ego, *legs.values()), streams, walked=walked)
    summary = (
        f"Junction {at.id!r} from {edge.id!r}: {_listed([WHO[name] for name in legs])} "
        f"{'crosses or turns' if len(legs) == 1 else 'cross or turn'}{', and a pedestrian walks' if walked else ''}."
    )
    like = {"family": "dense", "actors": {name: name for name in (*legs, *["pedestrian"] * walked)}}
    scenario = parts.scenario_of(spot, summary, ["iso34502:intersection"], like, fields)
    return Fit(spot, scenario, (*(way for one in (ego, *legs.values()) for way in one.turns), *streams.values()))


@dataclass(frozen=True, slots=True)
class Leg:
    """Road to a junction, with a vehicle's tracks across it."""

    name: str  # of the vehicle
    limit_mps: float
    words: tuple[str, ...]  # of the turns
    turns: tuple[Track, ...]  # by where they lead, from left to right; the reference is the stop line
    signalised: bool  # whether each has a signal


def _fields(net: Net, own: Approach, legs: Sequence[Leg], streams: Mapping[str, Track], *, walked: bool) -> Fields:
    """States a junction's document fields; the first leg is the ego's."""
    offset, signal = parts.signal_parts(net, [link.signal for link in own.links])
    parameters: Fields = {}
    for one in legs:
        parameters |= _parameters(one)
    if walked:
        parameters |= parts.walking("pedestrian across the near crossing's axis")
    if streams:
        parameters["background_gap_m"] = parts.number((15.0, WIDEST_GAP_M), "m", "spacing of the background vehicles")
    actors = {one.name: _moving(net, one) for one in legs[1:]}
    if walked:
        actors["pedestrian"] = parts.pedestrian(own.edge.id)
    traffic = {
        name: {
            "lane": parts.lane_of(net, way),
            "from_m": STREAM_M,
            "gap_m": "background_gap_m",
            "speed": STREAM_MPS,
            "route": parts.route_of(net, way),
        }
        for name, way in streams.items()
    }
    fastest_mps = max(one.limit_mps for one in legs)
    odd = {"dynamic": {"vehicle_speed_mps": {"low": 0.0, "high": fastest_mps * MOST_OVER_LIMIT}}}
    return {
        "parameters": parameters | offset | parts.friction(),
        "ego": _moving(net, legs[0]),
        "actors": actors,
        "streams": traffic,
        **({"odd": odd} if fastest_mps > legs[0].limit_mps else {}),
        **signal,
    }


def _parameters(leg: Leg) -> Fields:
    name, who = leg.name, WHO[leg.name]
    turn = {f"{name}_turn": {"words": leg.words, "meaning": f"which way {who} goes"}} if len(leg.words) > 1 else {}
    room_m = min(way.room_m for way in leg.turns)
    high_m = parts.at_most(FARTHEST_M, room_m - CAR_LENGTH_M - LEAD_IN_S * parts.top_speed(leg.limit_mps))
    distance = parts.number((NEAREST_M, high_m), "m", f"{who}'s front to its stop line")
    speed = parts.initial_speed(f"{name}_speed_mps", 5, leg.limit_mps, f"initial speed of {who}")
    return {**turn, f"{name}_distance_m": distance, **speed}


def _moving(net: Net, leg: Leg) -> Fields:
    """States a leg's vehicle; its turn's word chooses lane and route."""

    def chosen(values: Sequence[Any]) -> Any:
        if all(value == values[0] for value in values):
            return values[0]
        return {"by": f"{leg.name}_turn", "of": dict(zip(leg.words, values, strict=True))}

    lane, route = (chosen([part(net, way) for way in leg.turns]) for part in (parts.lane_of, parts.route_of))
    before = "stop_line" if leg.signalised else "junction"
    start = {"lane": lane, "before": before, "distance_m": f"{leg.name}_distance_m"}
    return {"start": start, "speed": f"{leg.name}_speed_mps", "route": route}


def approach(net: Net, edge: Edge) -> Approach:
    """Finds a road's ways on, each from its leftmost lane; raises `NoFit`."""
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
    """Finds a vehicle's tracks across the junction; raises `NoFit` without room."""
    links, tracks, whys = list[Link](), list[Track](), list[NoFit]()
    check_limit(road.links[0].source)
    limit_mps = road.links[0].source.limit_mps
    for link in road.links:
        try:
            tracks.append(roomy(turn(net, link, onward_s), road.edge.id, _room_wanted_m(limit_mps)))
            links.append(link)
        except NoFit as why:
            whys.append(why)
    if not tracks:
        raise whys[0]
    signalised = all(any(other.signal for other in net.onward[link.source.id]) for link in links)
    return Leg(name, limit_mps, _words(links), tuple(tracks), signalised)


def _words(links: Sequence[Link]) -> tuple[str, ...]:
    """Names ways left to right: left, straight, right if distinct, else numbers."""
    turns_rad = [0.0 if abs(link.turn_rad) <= STRAIGHT_RAD else link.turn_rad for link in links]
    words = tuple("left" if turn_rad > 0.0 else "right" if turn_rad < 0.0 else "straight" for turn_rad in turns_rad)
    return words if len(set(words)) == len(words) else tuple(f"way_{i + 1}" for i in range(len(links)))


def _room_wanted_m(limit_mps: float) -> float:
    """Least room before a stop line."""
    return NEAREST_M + LEAST_RANGE_M + CAR_LENGTH_M + LEAD_IN_S * parts.top_speed(limit_mps)


def roomy(track: Track, edge: str, wanted_m: float) -> Track:
    """The track; raises `NoFit` if it begins too near to its reference."""
    if track.room_m < wanted_m:
        raise NoFit(f"the length of the way in on {edge!r} is {parts.lacking(track.room_m, 'm', wanted_m)}")
    return track


def turn(net: Net, link: Link, onward_s: float) -> Track:
    """Returns the track over a link; raises `NoFit` if it is obstructed."""
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
    """Returns the rightmost lane's straight track if other lanes remain."""
    if len(road.edge.drivable) < 2:
        return None
    links = net.onward.get(road.edge.drivable[0].id)
    if not links:
        return None
    with suppress(NoFit):
        found = turn(net, min(links, key=lambda link: abs(link.turn_rad)), ONWARD_S)
        return roomy(found, road.edge.id, STREAM_ROOM_M)
    return None


def _others(net: Net, own: Approach) -> Mapping[str, Approach]:
    """Finds roads with a way that is a foe of the ego's.

    Of several from one side it takes the one most square to it.
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
    """Returns another road's side, and its angle off that side, rad."""
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
