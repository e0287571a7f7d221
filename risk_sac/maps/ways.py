"""Ways through a net, lane by lane, and lanes for car following.

Such a lane can be driven on for an episode, and has room behind the ego.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

from risk_sac.maps import found as parts
from risk_sac.maps.found import Fields, Fit, NoFit, Spot
from risk_sac.scenario.ground import too_near
from risk_sac.scenario.lane_places import Track, pieces_of
from risk_sac.scenario.layout import CAR_LENGTH_M
from risk_sac.world.net import Edge, Link, Net, NetLane, once

DRIVEN_S = 17.0  # longer than an episode: the ego must not reach the end of the map
AFTER_S = 15.5  # the same behind a stop line: what is driven until the adversaries' release comes off
BEFORE_M = 160.0  # of road before a reference where vehicles could start
PIECES_M = 160.0  # of road beyond a reference where vehicles may start
OFF_SHARE = 0.02  # of a lane's length, by which its shape may be longer or shorter
OFF_M = 1.0  # the same of a short lane: SUMO's gaps are 2.5 m
TRIES = 300  # lanes that are looked at for a way on


@dataclass(frozen=True, slots=True)
class LaneWay:
    """Lanes and the links between them."""

    lanes: tuple[NetLane, ...]
    links: tuple[Link, ...]  # one fewer


def way_on(net: Net, first: NetLane, seconds: float, through: Link | None = None, from_m: float = 0.0) -> LaneWay:
    """Finds the straightest way of `seconds` at the limits without repeated edges.

    The seconds count from `from_m` along the first lane; `through` is the link that the way takes first.

    Raises:
      NoFit: every way is too short.
    """
    tries, farthest, reached_s = TRIES, first.edge, 0.0

    def extend(lanes: list[NetLane], links: list[Link], gone_s: float, following: Sequence[Link]) -> LaneWay | None:
        nonlocal tries, farthest, reached_s
        if gone_s > reached_s:
            farthest, reached_s = lanes[-1].edge, gone_s
        if gone_s >= seconds and (links or through is None):
            return LaneWay(tuple(lanes), tuple(links))
        been = {lane.edge for lane in lanes}
        for link in following:
            if link.target.edge in been or tries == 0 or too_near(net, link) is not None:
                continue
            tries -= 1
            inside_s = sum(lane.length_m / lane.limit_mps for lane in link.inside)
            after_s = gone_s + inside_s + link.target.length_m / link.target.limit_mps
            if way := extend([*lanes, link.target], [*links, link], after_s, _onward(net, link.target)):
                return way
        return None

    left_s = (first.length_m - from_m) / first.limit_mps
    way = extend([first], [], left_s, [through] if through else _onward(net, first))
    if way is None:
        found = f"the longest way on that was found ends with edge {farthest!r}"
        raise NoFit(f"{found} after driving {parts.lacking(reached_s, 's', seconds)}")
    return way


@once
def _onward(net: Net, lane: NetLane) -> list[Link]:
    return sorted(net.onward.get(lane.id, ()), key=_bend)


def way_back(net: Net, last: NetLane, metres: float, onward: Sequence[str] = ()) -> LaneWay:
    """Returns the straightest way to a lane, `metres` long at most.

    It ends earlier where the map ends; where a lane forks into several of the next road, and SUMO would drive into
    another of them than the one on the way; and at a signal, since a vehicle that starts before it may stand at its red
    light until the end. `onward` are the edges that are driven after the lane's.
    """
    lanes, links, length_m = [last], list[Link](), 0.0
    while length_m < metres:
        been = {lane.edge for lane in lanes}
        following = [*(lane.edge for lane in lanes[1:]), *onward]
        arriving = net.back.get(lanes[0].id, ())
        before = [
            link
            for link in arriving
            if link.signal is None
            and link.source.edge not in been
            and _is_taken(net, link, following)
            and too_near(net, link) is None
        ]
        if not before:
            break
        link = min(before, key=_bend)
        lanes.insert(0, link.source)
        links.insert(0, link)
        length_m += link.source.length_m + link.inside_m
    return LaneWay(tuple(lanes), tuple(links))


def track(net: Net, on: LaneWay, reference_m: float, beyond_m: float = 0.0) -> Track:
    """The track of a way, with the lanes that lead to it.

    The reference lies `reference_m` from the beginning of its first lane; vehicles may start `beyond_m` beyond it.
    """
    back = way_back(net, on.lanes[0], BEFORE_M - reference_m, [lane.edge for lane in on.lanes[1:]])
    been = {lane.edge for lane in on.lanes}
    first = next((i + 1 for i in reversed(range(len(back.lanes) - 1)) if back.lanes[i].edge in been), 0)
    lanes, links = [*back.lanes[first:], *on.lanes[1:]], [*back.links[first:], *on.links]
    own = len(back.lanes) - 1 - first
    pieces = pieces_of(lanes, links, own, reference_m)
    most = max(i for i, piece in enumerate(pieces) if i <= own or piece.reach_m > -beyond_m)
    return Track(pieces=pieces[: most + 1], onward=tuple(piece.edge for piece in pieces[most + 1 :]))


def _is_taken(net: Net, link: Link, following: Sequence[str]) -> bool:
    """Whether SUMO's drivers take a link among alternatives to the same road.

    They take the one to the lane from which they come farthest along their route without a lane change, and of equals
    the one to the right.
    """
    alike = [each for each in net.onward[link.source.id] if each.target.edge == link.target.edge]
    return len(alike) == 1 or link is max(
        alike, key=lambda each: (_reach(net, each.target, following), -each.target.index)
    )


def _reach(net: Net, lane: NetLane, following: Sequence[str]) -> int:
    """Along how many of the edges that follow a lane leads."""
    lanes = {lane.id}
    for reached, edge in enumerate(following):
        lanes = {link.target.id for id_ in lanes for link in net.onward.get(id_, ()) if link.target.edge == edge}
        if not lanes:
            return reached
    return len(following)


def check_lengths(net: Net, tracks: Iterable[Track]) -> None:
    """Raises `NoFit` if a lane's `length` is not that of its shape.

    SUMO drives by the `length`, the tracks follow the shape.
    """
    for each in tracks:
        edges = [*(piece.edge for piece in each.pieces), *each.onward]
        for edge, following in zip(edges, [*edges[1:], ""], strict=True):
            if (lane := _off_length(net, edge, following)) is not None:
                got = f"lane {lane.id!r} has the length {lane.length_m:.2f} m and a shape of {_drawn_m(lane):.2f} m"
                raise NoFit(
                    f"{got}; wanted a difference of at most {_most_off_m(lane):.2f} m ({OFF_SHARE:.0%}, or {OFF_M:g} m)"
                )


@once
def _off_length(net: Net, edge: str, following: str) -> NetLane | None:
    """Finds a lane of an edge, or onward, whose stated length differs."""
    lanes = net.edges[edge].drivable
    links = (link for lane in lanes for link in net.onward.get(lane.id, ()) if link.target.edge == following)
    used = (*lanes, *(lane for link in links for lane in link.inside))
    off = (lane for lane in used if abs(_drawn_m(lane) - lane.length_m) > _most_off_m(lane))
    return next(off, None)


def _drawn_m(lane: NetLane) -> float:
    return round(sum(math.dist(a, b) for a, b in pairwise(lane.line)), 2)


def _most_off_m(lane: NetLane) -> float:
    return round(max(OFF_M, OFF_SHARE * lane.length_m), 2)


def _bend(link: Link) -> float:
    return abs(link.turn_rad)


BEHIND_M, AHEAD_M = 15.0, 25.0  # range of the neighbours' fronts relative to the ego's
LEAST_FOLLOWING_M, MOST_FOLLOWING_M = 10.0, 40.0  # range of the gap behind the ego
CLEAR_M = 1.0  # length that a track has left behind the last vehicle on it
DISTANT_M = 60.0  # distance of the distant vehicle beyond the leader
LEAST_BEHIND_M = 8.0  # room that a place must have behind the ego
SLOWEST_MPS, FASTEST_MPS = 5.0, 60.0
SHORTEST_M = 20.0  # of an edge that counts as a road of its own
BESIDE_S = 6.0  # of driving that a neighbour's lane has to lead on
SIGNAL_S = 12.0  # of driving within which a signal matters


def stretch_spots(net: Net) -> Iterator[Spot]:
    """Every road for cars that is long enough to count."""
    for edge in net.edges.values():
        if edge.drivable and edge.drivable[0].length_m >= SHORTEST_M:
            lane = edge.drivable[len(edge.drivable) // 2]
            x, y = lane.line[len(lane.line) // 2]
            yield Spot(pattern="car_following", id=edge.id, x_m=x, y_m=y)


def fit_stretch(net: Net, spot: Spot) -> Fit:
    """Writes car following on a road; raises `NoFit` without room."""
    edge = net.edges[spot.id]
    check_limit(edge.drivable[0])
    reference_m = round(edge.drivable[0].length_m / 2, 2)
    own, way = _lane_to_drive(net, edge, reference_m)
    ego = track(net, way, reference_m, PIECES_M)
    if ego.room_m < LEAST_BEHIND_M:
        raise NoFit(f"the room behind the ego is {parts.lacking(ego.room_m, 'm', LEAST_BEHIND_M)}")
    aside = {1: "left", -1: "right"}
    lanes = {aside[n]: lane for lane in edge.drivable if (n := lane.index - own.index) in aside}
    sides = {side: beside for side in ("left", "right") if (beside := _beside(net, lanes.get(side), reference_m))}
    followed = ego.room_m >= LEAST_FOLLOWING_M + 2 * CAR_LENGTH_M + CLEAR_M
    offset, signal = parts.signal_parts(net, [link.signal for link in _soon(way, own.length_m - reference_m)])
    actors: Fields = {"lead": {"start": {"ahead_of": "ego", "gap_m": "lead_gap_m"}, "speed": "lead_speed_mps"}}
    parameters = {
        **parts.initial_speed("ego_speed_mps", 8, own.limit_mps, "initial speed of the ego"),
        "lead_gap_m": parts.number((8.0, 50.0), "m", "gap from the ego's front to the leader's rear"),
        **parts.initial_speed("lead_speed_mps", 6, own.limit_mps, "initial speed of the leader"),
    }
    for side, beside in sides.items():
        lanes_left = 1 if side == "left" else -1
        actors[side] = {
            "start": {"beside": "ego", "ahead_m": f"{side}_offset_m", "lanes_left": lanes_left},
            "speed": f"{side}_speed_mps",
            "route": parts.route_of(net, beside),
        }
        low_m = -parts.at_most(BEHIND_M, beside.room_m - CAR_LENGTH_M - CLEAR_M)
        parameters[f"{side}_offset_m"] = parts.number(
            (low_m, AHEAD_M), "m", f"{side} neighbour's front relative to the ego's"
        )
        parameters |= parts.initial_speed(
            f"{side}_speed_mps", 6, own.limit_mps, f"initial speed of the {side} neighbour"
        )
    if followed:
        behind = {"behind": "ego", "gap_m": "follower_gap_m"}
        actors["follower"] = {"role": "background", "start": behind, "speed": "ego_speed_mps"}
        high_m = parts.at_most(MOST_FOLLOWING_M, ego.room_m - 2 * CAR_LENGTH_M - CLEAR_M)
        meaning = "gap from the follower's front to the ego's rear"
        parameters["follower_gap_m"] = parts.number((LEAST_FOLLOWING_M, high_m), "m", meaning)
    ahead = {"beside": "ego", "ahead_m": f"lead_gap_m + {DISTANT_M:g}"}
    actors["distant"] = {"role": "background", "start": ahead, "speed": "lead_speed_mps"}
    start = {"lane": parts.lane_of(net, ego), "at_m": reference_m, "lead_in": False}
    fields = {
        "parameters": parameters | offset | parts.friction(),
        "ego": {"start": start, "speed": "ego_speed_mps", "route": parts.route_of(net, ego)},
        "actors": actors,
        **signal,
    }
    # Most failures of the shipped family come from its left.
    like = {"family": "low", "actors": {name: name for name in ("lead", *sides)}, "mirrored": [*sides] == ["right"]}
    tags = ["iso34502:deceleration", *["iso34502:cut-in"] * bool(sides)]
    scenario = parts.scenario_of(spot, _summary(edge.id, tuple(sides)), tags, like, fields)
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
