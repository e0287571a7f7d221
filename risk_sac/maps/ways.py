"""Ways through a net, lane by lane: what leads to a place, and what leads on from it."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from risk_sac.maps.found import NoFit, lacking
from risk_sac.scenario.clearance import too_near
from risk_sac.scenario.tracks import Piece, Track
from risk_sac.world.net import Link, Net, NetLane, once

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
    """Finds the straightest way on that takes `seconds` at the speed limits.

    It uses no edge twice.

    Args:
      net: where.
      first: lane that the way begins with.
      seconds: of driving.
      through: link that the way takes first.
      from_m: along the first lane, from where the seconds count.

    Raises:
      NoFit: every way is too short.
    """
    tries, farthest, reached_s = TRIES, first.edge, 0.0

    def extend(lanes: list[NetLane], links: list[Link], gone_s: float, following: Sequence[Link]) -> LaneWay | None:
        """Searches depth first, the straightest way first."""
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
        raise NoFit(f"{found} after driving {lacking(reached_s, 's', seconds)}")
    return way


@once
def _onward(net: Net, lane: NetLane) -> list[Link]:
    return sorted(net.onward.get(lane.id, ()), key=_bend)


def way_back(net: Net, last: NetLane, metres: float, onward: Sequence[str] = ()) -> LaneWay:
    """The straightest way to a lane, `metres` of it before that lane; shorter where the map ends.

    It also ends where a lane forks into several of the next road, and SUMO would drive into another of them than the
    one on the way; and at a signal, since a vehicle that starts before it may stand at its red light until the end.
    `onward` are the edges that are driven after the lane's.
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

    Args:
      net: where.
      on: its first lane has the reference.
      reference_m: from the beginning of that lane.
      beyond_m: how far beyond the reference a vehicle may start.
    """
    back = way_back(net, on.lanes[0], BEFORE_M - reference_m, [lane.edge for lane in on.lanes[1:]])
    been = {lane.edge for lane in on.lanes}
    first = next((i + 1 for i in reversed(range(len(back.lanes) - 1)) if back.lanes[i].edge in been), 0)
    lanes, links = [*back.lanes[first:], *on.lanes[1:]], [*back.links[first:], *on.links]
    own = len(back.lanes) - 1 - first
    reach_m = [0.0] * len(lanes)
    reach_m[own] = reference_m
    for i in reversed(range(own)):
        reach_m[i] = reach_m[i + 1] + links[i].inside_m + lanes[i].length_m
    for i in range(own + 1, len(lanes)):
        reach_m[i] = reach_m[i - 1] - lanes[i - 1].length_m - links[i - 1].inside_m
    pieces = tuple(_piece(lane, reach) for lane, reach in zip(lanes, reach_m, strict=True))
    most = max(i for i, piece in enumerate(pieces) if i <= own or piece.reach_m > -beyond_m)
    return Track(pieces=pieces[: most + 1], onward=tuple(piece.edge for piece in pieces[most + 1 :]))


def _is_taken(net: Net, link: Link, following: Sequence[str]) -> bool:
    """Whether SUMO's drivers take a link, of those that lead from its lane to the same road.

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


def edges_on(*tracks: Track) -> set[str]:
    """Lists all edges that vehicles on the tracks may reach."""
    return {piece.edge for track in tracks for piece in track.pieces} | {e for track in tracks for e in track.onward}


def check_lengths(net: Net, tracks: Iterable[Track]) -> None:
    """Raises `NoFit` if a lane on tracks is longer or shorter than its shape.

    SUMO drives a lane by its `length`, and places bodies by its shape.
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
    """A lane of an edge, or from there to the following one, whose shape has another length."""
    lanes = net.edges[edge].drivable
    links = (link for lane in lanes for link in net.onward.get(lane.id, ()) if link.target.edge == following)
    used = (*lanes, *(lane for link in links for lane in link.inside))
    off = (lane for lane in used if abs(_drawn_m(lane) - lane.length_m) > _most_off_m(lane))
    return next(off, None)


def _drawn_m(lane: NetLane) -> float:
    return round(sum(math.dist(a, b) for a, b in pairwise(lane.line)), 2)


def _most_off_m(lane: NetLane) -> float:
    return round(max(OFF_M, OFF_SHARE * lane.length_m), 2)


def _piece(lane: NetLane, reach_m: float) -> Piece:
    reach_m, length_m = round(reach_m, 2), lane.length_m
    return Piece(edge=lane.edge, lane=lane.index, reach_m=reach_m, length_m=length_m, limit_mps=lane.limit_mps)


def _bend(link: Link) -> float:
    return abs(link.turn_rad)
