"""Finds lanes for car following.

Such a lane can be driven on for an episode, and has room behind the ego.
"""

from collections.abc import Iterator
from contextlib import suppress

from risk_sac.maps.found import Fit, NoFit, Spot, lacking
from risk_sac.maps.scenarios import (
    Fields,
    at_most,
    friction,
    initial_speed,
    lane_of,
    number,
    route_of,
    scenario_of,
    signal_parts,
)
from risk_sac.maps.ways import DRIVEN_S, PIECES_M, LaneWay, track, way_on
from risk_sac.scenario.layout import CAR_LENGTH_M
from risk_sac.scenario.tracks import Track
from risk_sac.world.net import Edge, Link, Net, NetLane

BEHIND_M, AHEAD_M = 15.0, 25.0  # range of the neighbours' fronts relative to the ego's
LEAST_FOLLOWING_M, MOST_FOLLOWING_M = 10.0, 40.0  # range of the gap behind the ego
CLEAR_M = 1.0  # length that a track has left behind the last vehicle on it
DISTANT_M = 60.0  # distance of the distant vehicle beyond the leader
LEAST_BEHIND_M = 8.0  # room that a place must have behind the ego
SLOWEST_MPS, FASTEST_MPS = 5.0, 60.0
SHORTEST_M = 20.0  # of an edge that counts as a road of its own
BESIDE_S = 6.0  # of driving that a neighbour's lane has to lead on
SIGNAL_S = 12.0  # of driving within which a signal matters


def spots(net: Net) -> Iterator[Spot]:
    """Every road for cars that is long enough to count."""
    for edge in net.edges.values():
        if edge.drivable and edge.drivable[0].length_m >= SHORTEST_M:
            lane = edge.drivable[len(edge.drivable) // 2]
            x, y = lane.line[len(lane.line) // 2]
            yield Spot(pattern="car_following", id=edge.id, x_m=x, y_m=y)


def fit(net: Net, spot: Spot) -> Fit:
    """Writes car following on a road; raises `NoFit` where it has no room."""
    edge = net.edges[spot.id]
    check_limit(edge.drivable[0])
    reference_m = round(edge.drivable[0].length_m / 2, 2)
    own, way = _lane_to_drive(net, edge, reference_m)
    ego = track(net, way, reference_m, PIECES_M)
    if ego.room_m < LEAST_BEHIND_M:
        raise NoFit(f"the room behind the ego is {lacking(ego.room_m, 'm', LEAST_BEHIND_M)}")
    aside = {1: "left", -1: "right"}
    lanes = {aside[n]: lane for lane in edge.drivable if (n := lane.index - own.index) in aside}
    sides = {side: beside for side in ("left", "right") if (beside := _beside(net, lanes.get(side), reference_m))}
    followed = ego.room_m >= LEAST_FOLLOWING_M + 2 * CAR_LENGTH_M + CLEAR_M
    offset, signal = signal_parts(net, [link.signal for link in _soon(way, own.length_m - reference_m)])
    actors: Fields = {"lead": {"start": {"ahead_of": "ego", "gap_m": "lead_gap_m"}, "speed": "lead_speed_mps"}}
    parameters = {
        **initial_speed("ego_speed_mps", 8, own.limit_mps, "initial speed of the ego"),
        "lead_gap_m": number((8.0, 50.0), "m", "gap from the ego's front to the leader's rear"),
        **initial_speed("lead_speed_mps", 6, own.limit_mps, "initial speed of the leader"),
    }
    for side, beside in sides.items():
        lanes_left = 1 if side == "left" else -1
        actors[side] = {
            "start": {"beside": "ego", "ahead_m": f"{side}_offset_m", "lanes_left": lanes_left},
            "speed": f"{side}_speed_mps",
            "route": route_of(net, beside),
        }
        low_m = -at_most(BEHIND_M, beside.room_m - CAR_LENGTH_M - CLEAR_M)
        parameters[f"{side}_offset_m"] = number(
            (low_m, AHEAD_M), "m", f"{side} neighbour's front relative to the ego's"
        )
        parameters |= initial_speed(f"{side}_speed_mps", 6, own.limit_mps, f"initial speed of the {side} neighbour")
    if followed:
        behind = {"behind": "ego", "gap_m": "follower_gap_m"}
        actors["follower"] = {"role": "background", "start": behind, "speed": "ego_speed_mps"}
        high_m = at_most(MOST_FOLLOWING_M, ego.room_m - 2 * CAR_LENGTH_M - CLEAR_M)
        meaning = "gap from the follower's front to the ego's rear"
        parameters["follower_gap_m"] = number((LEAST_FOLLOWING_M, high_m), "m", meaning)
    ahead = {"beside": "ego", "ahead_m": f"lead_gap_m + {DISTANT_M:g}"}
    actors["distant"] = {"role": "background", "start": ahead, "speed": "lead_speed_mps"}
    start = {"lane": lane_of(net, ego), "at_m": reference_m, "lead_in": False}
    fields = {
        "parameters": parameters | offset | friction(),
        "ego": {"start": start, "speed": "ego_speed_mps", "route": route_of(net, ego)},
        "actors": actors,
        **signal,
    }
    # Most failures of the shipped family come from its left.
    like = {"family": "low", "actors": {name: name for name in ("lead", *sides)}, "mirrored": [*sides] == ["right"]}
    tags = ["iso34502:deceleration", *["iso34502:cut-in"] * bool(sides)]
    scenario = scenario_of(spot, _summary(edge.id, tuple(sides)), tags, like, fields)
    return Fit(spot, scenario, (ego, *sides.values()), rare=not sides)


def _summary(edge: str, sides: tuple[str, ...]) -> str:
    head = f"Car following on {edge!r}: the vehicle ahead"
    if not sides:
        return f"{head} brakes and adapts its speed."
    beside = "those on the left and right" if len(sides) > 1 else f"the one on the {sides[0]}"
    return f"{head} and {beside} brake, adapt their speed and cut in."


def check_limit(lane: NetLane) -> None:
    """Raises `NoFit` for a road whose speed limit is none for cars."""
    if not SLOWEST_MPS <= lane.limit_mps <= FASTEST_MPS:
        wanted = f"wanted {SLOWEST_MPS:g} to {FASTEST_MPS:g} m/s"
        raise NoFit(f"the speed limit of {lane.edge!r} is {lane.limit_mps} m/s; {wanted}")


def _lane_to_drive(net: Net, edge: Edge, reference_m: float) -> tuple[NetLane, LaneWay]:
    """The lane nearest to the middle that leads on for an episode."""
    middle = edge.drivable[len(edge.drivable) // 2].index
    whys = []
    for lane in sorted(edge.drivable, key=lambda lane: abs(lane.index - middle)):
        try:
            return lane, way_on(net, lane, DRIVEN_S, from_m=reference_m)
        except NoFit as why:
            whys.append(why)
    raise whys[0]


def _beside(net: Net, lane: NetLane | None, reference_m: float) -> Track | None:
    if lane is None:
        return None
    with suppress(NoFit):
        way = way_on(net, lane, BESIDE_S, from_m=reference_m)
        beside = track(net, way, reference_m, PIECES_M)
        return beside if beside.room_m >= LEAST_BEHIND_M else None
    return None


def _soon(way: LaneWay, left_m: float) -> list[Link]:
    links, gone_s = list[Link](), left_m / way.lanes[0].limit_mps
    for link, lane in zip(way.links, way.lanes[1:], strict=True):
        if gone_s > SIGNAL_S:
            break
        links.append(link)
        gone_s += lane.length_m / lane.limit_mps
    return links
