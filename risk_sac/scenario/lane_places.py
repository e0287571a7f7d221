"""Places on a SUMO net's lanes, and vehicles' ways, lane by lane."""

import itertools
import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from heapq import heappop, heappush
from typing import Literal, NamedTuple

import numpy as np
import shapely

from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.scenario.travel_line import Pose, TravelLine, line_of
from risk_sac.world.net import Link, Net, NetLane, once
from risk_sac.world.read_net import DRIVER
from risk_sac.world.types import Floats

FARTHEST_M = 30.0  # of a pose from the line of its lane
TURNED_M = 3.0  # choice: what a lane at right angles to a pose is farther away by than one along it


class LanePlace(NamedTuple):
    """Place on a lane of the SUMO net."""

    lane: NetLane
    at_m: float  # along the lane's line
    left_m: float  # of the lane's line


class _Pieces(NamedTuple):
    """Straight pieces of the lines of all lanes for cars."""

    lanes: list[NetLane]
    rows: Floats  # x, y, cos, sin, length and station of each
    tree: shapely.STRtree  # of the pieces


@once
def _pieces(net: Net) -> _Pieces:
    lanes, rows = list[NetLane](), [np.empty((0, 6))]
    for lane in net.lanes.values():
        if lane.drivable and lane.use in ("lane", "inside"):
            line = lane_line(lane)
            steps, lengths = np.diff(line.points, axis=0), np.diff(line.station_m)
            rows.append(np.column_stack((line.points[:-1], steps / lengths[:, None], lengths, line.station_m[:-1])))
            lanes += [lane] * len(lengths)
    pieces = np.concatenate(rows)
    ends = pieces[:, :2] + pieces[:, 2:4] * pieces[:, 4:5]
    return _Pieces(lanes, pieces, shapely.STRtree(shapely.linestrings(np.stack((pieces[:, :2], ends), axis=1))))


@lru_cache(maxsize=4096)
def lane_line(lane: NetLane) -> TravelLine:
    """Returns a lane's middle."""
    return line_of(lane.centre)


def nearest_lane(
    net: Net, x_m: float, y_m: float, heading_rad: float | None, among: Collection[str] = ()
) -> LanePlace | None:
    """Returns the place on the nearest lane for cars within 30 m.

    The lane leads within 90° of the heading, if there is one; lanes with the original names `among` are preferred, such
    as `0_-4`.
    """
    lanes, rows, tree = _pieces(net)
    if not (math.isfinite(x_m) and math.isfinite(y_m)):
        return None
    near = tree.query(shapely.Point(x_m, y_m), predicate="dwithin", distance=FARTHEST_M)
    if among:
        named = [i for i in near.tolist() if not set(among).isdisjoint(lanes[i].original)]
        near = np.array(named, dtype=np.intp) if named else near
    x, y, cos, sin, lengths, stations = rows[near].T
    dx, dy = x_m - x, y_m - y
    on = np.clip(dx * cos + dy * sin, 0.0, lengths)
    apart = np.hypot(dx - on * cos, dy - on * sin)
    if heading_rad is not None:
        fit = cos * math.cos(heading_rad) + sin * math.sin(heading_rad)
        apart = np.where(fit > 0.0, apart + TURNED_M * (1.0 - fit), np.inf)
    if not len(near) or not np.isfinite(apart.min()):
        return None
    i = int(np.argmin(apart))
    return LanePlace(lanes[near[i]], float(stations[i] + on[i]), float(dy[i] * cos[i] - dx[i] * sin[i]))


def spot_pose(spot: LanePlace) -> Pose:
    """Returns the pose of a place, in the lane's direction."""
    return lane_line(spot.lane).pose(spot.at_m, spot.left_m)


def beside(net: Net, spot: LanePlace, lanes: int) -> LanePlace | None:
    """Returns the place `lanes` to the left, at equal height, or None."""
    other = net.lanes.get(f"{spot.lane.edge}_{spot.lane.index + lanes}")
    if other is None or not other.drivable:
        return None
    x_m, y_m, _ = spot_pose(spot)
    return LanePlace(other, *lane_line(other).project(x_m, y_m))


def lanes_ahead(net: Net, lane: NetLane, length_m: float, edges: Sequence[str] = ()) -> list[NetLane]:
    """Returns a lane and those after it, along `edges`, else straight on."""
    lanes, left_m = [lane], length_m
    while left_m > 0.0:
        links = _links(net, lanes[-1])
        links = [link for link in links if link.target.edge in edges] or links
        if not links or links[0].target in lanes:
            break
        lanes += [*links[0].inside, links[0].target]
        left_m -= links[0].inside_m + links[0].target.length_m
    return lanes


def _through(net: Net, lane: NetLane) -> Link | None:
    return next((link for links in net.onward.values() for link in links if lane in link.inside), None)


def entry_of(net: Net, lane: NetLane) -> NetLane | None:
    """Returns the lane before one inside a junction."""
    link = _through(net, lane)
    return None if link is None else link.source


def _links(net: Net, lane: NetLane) -> list[Link]:
    """Returns a lane's links, the straightest first."""
    if lane.use == "inside":
        link = _through(net, lane)
        return [] if link is None else [Link(lane, link.target, link.inside[link.inside.index(lane) + 1 :], None, None)]
    return sorted(net.onward.get(lane.id, ()), key=lambda link: abs(link.turn_rad))


def edge_path(net: Net, begin: str, end: str) -> list[str] | None:
    """Returns the edges of the shortest way, both ends included, or None."""
    order, queue, seen = itertools.count(1), [(0.0, 0, [begin])], set[str]()
    while queue:
        length_m, _, path = heappop(queue)
        if path[-1] == end:
            return path
        if path[-1] in seen:
            continue
        seen.add(path[-1])
        for lane in net.edges[path[-1]].drivable:
            for link in net.onward.get(lane.id, ()):
                if (target := link.target.edge) not in seen:
                    through_m = length_m + link.inside_m + link.target.length_m
                    heappush(queue, (through_m, next(order), [*path, target]))
    return None


def joined(net: Net, edges: Iterable[str]) -> list[str]:
    """Returns edges in driving order, with those between them that lead on."""
    path = list[str]()
    for edge in edges:
        if not path:
            path = [edge]
        elif edge != path[-1]:
            path += (edge_path(net, path[-1], edge) or [edge])[1:]
    return path


def extended(net: Net, edges: Sequence[str], metres: float) -> tuple[str, ...]:
    """Extends a way straight on until it is long enough or ends."""
    way = list(edges)
    left_m = metres - sum(net.edges[edge].lanes[0].length_m for edge in way)
    while left_m > 0.0:
        links = [link for lane in net.edges[way[-1]].drivable for link in net.onward.get(lane.id, ())]
        links = [link for link in links if link.target.edge not in way]
        if not links:
            break
        link = min(links, key=lambda link: abs(link.turn_rad))
        way.append(link.target.edge)
        left_m -= link.inside_m + link.target.length_m
    return tuple(way)


Turn = Literal["left", "straight", "right"]
STRAIGHT_RAD = math.radians(30.0)  # largest bend of a way that goes straight on
BACK_M = 400.0  # of road before a reference, where no route says more


@dataclass(frozen=True, slots=True)
class Piece:
    """Lane before or beyond a reference, such as a stop line."""

    edge: str
    lane: int  # index on its edge; 0 is the rightmost
    reach_m: float  # from the beginning of the lane to the reference; negative beyond it
    length_m: float
    limit_mps: float


@dataclass(frozen=True, slots=True)
class Track:
    """A way through the net on which vehicles start, lane by lane."""

    pieces: tuple[Piece, ...]  # in the order of driving; those inside junctions are left out
    onward: tuple[str, ...]  # edges that follow the last piece

    @property
    def room_m(self) -> float:
        """Length of the track before its reference, m."""
        return self.pieces[0].reach_m

    @property
    def edges(self) -> tuple[str, ...]:
        """All edges, in the order of driving."""
        return tuple(piece.edge for piece in self.pieces) + self.onward

    def start(self, before_m: float, lead_m: float = 0.0) -> tuple[tuple[str, ...], Piece, float]:
        """Returns route, lane and position of a front bumper before the reference.

        It is `before_m` and `lead_m` before it; a start inside a junction moves to the junction's entry.
        """
        first = len(self.pieces) - 1
        while first > 0 and self.pieces[first].reach_m - before_m - lead_m < 0.0:
            first -= 1
        piece = self.pieces[first]
        position_m = min(max(piece.reach_m - before_m - lead_m, 0.0), piece.length_m)
        return tuple(piece.edge for piece in self.pieces[first:]) + self.onward, piece, position_m


def lane_named(
    net: Net,
    name: str,
    field: str,
    leading: "Sequence[str] | Turn | None" = None,
    classes: Collection[str] | None = (DRIVER,),
) -> NetLane:
    """Returns a lane by its name or its edge's; raises `ConfigError`.

    Args:
      net: where.
      name: a lane, or an edge, of which the leftmost lane is taken that leads on.
      field: path of the name in the document.
      leading: edges that the way goes on with, or a turn.
      classes: of SUMO, of which it has to admit one; None: any lane of a road does.
    """
    if name in net.edges:
        lanes = net.edges[name].drivable
        if isinstance(leading, str):
            fits = [lane for lane in lanes if any(_turns(link, leading) for link in net.onward.get(lane.id, ()))]
        else:
            fits = [lane for lane in lanes if not leading or _links_to(net, lane, leading[0])] or list(lanes)
        if fits:
            return fits[-1]
        if lanes:
            raise ConfigError(field, f"{name!r}, from which no lane leads {leading}", "another edge or turn")
    lane = net.lanes.get(name)
    if lane is None or lane.use != "lane":
        raise ConfigError(field, repr(name), "a lane or an edge of the net", _near(name, [*net.edges, *net.lanes]))
    if classes is not None and not lane.admits(classes):
        got = f"{name!r}, on which no {' or '.join(classes)} may drive"
        raise ConfigError(field, got, f"a lane for {' or '.join(classes)}")
    return lane


def _near(name: str, known: Sequence[str]) -> str:
    shown = [id_ for id_ in known if not id_.startswith(":")]
    listed = ", ".join(shown[:12]) + (", …" if len(shown) > 12 else "")
    return did_you_mean(name, shown) or f"the net has {listed}"


def _turns(link: Link, turn: str) -> bool:
    if turn == "straight":
        return abs(link.turn_rad) <= STRAIGHT_RAD
    return link.turn_rad > STRAIGHT_RAD if turn == "left" else link.turn_rad < -STRAIGHT_RAD


def _links_to(net: Net, lane: NetLane, edge: str) -> list[Link]:
    """Links of a lane to an edge, the straightest first."""
    links = [link for link in net.onward.get(lane.id, ()) if link.target.edge == edge]
    return sorted(links, key=lambda link: abs(link.turn_rad))


def routed(net: Net, lane: NetLane, reference_m: float, route: Sequence[str], field: str) -> Track:
    """Track of a route of edges or lanes, through the reference.

    The reference is a lane and m from its beginning.

    Raises:
      ConfigError: an edge is not there, two do not meet, or the lane is not on it.
    """
    edges = [item if item in net.edges else lane_named(net, item, f"{field}[{i}]").edge for i, item in enumerate(route)]
    for i, (edge, following) in enumerate(itertools.pairwise(edges)):
        if not any(_links_to(net, drivable, following) for drivable in net.edges[edge].drivable):
            beyond = sorted({k.target.edge for d in net.edges[edge].drivable for k in net.onward.get(d.id, ())})
            wanted = f"an edge that {edge!r} leads to: {', '.join(beyond) or 'there is none'}"
            raise ConfigError(f"{field}[{i + 1}]", repr(following), wanted)
    if lane.edge not in edges:
        raise ConfigError(field, ", ".join(route), f"a route over {lane.edge!r}, where the actor starts")
    own = edges.index(lane.edge)
    lanes, links = [lane], list[Link]()
    for i in reversed(range(own)):
        arriving = [link for link in net.back.get(lanes[0].id, ()) if link.source.edge == edges[i]]
        arriving = [link for link in arriving if route[i] in (edges[i], link.source.id)]
        if not arriving:
            break
        links.insert(0, min(arriving, key=lambda link: abs(link.turn_rad)))
        lanes.insert(0, links[0].source)
    return _track(lanes, links, lanes.index(lane), reference_m, *_ahead(net, lane, edges[own + 1 :], route[own + 1 :]))


def straight_on(net: Net, lane: NetLane, reference_m: float, metres: float, turn: str | None, field: str) -> Track:
    """Returns the track straight on from a lane, after an optional turn.

    The turn is at the lane's end.

    The reference lies `reference_m` from the lane's beginning; the way may end after so many metres.

    Raises:
      ConfigError: the lane does not turn so.
    """
    ahead, length_m, here = list[str](), lane.length_m - reference_m, lane
    while length_m < metres:
        been = {lane.edge, *ahead}
        links = sorted(net.onward.get(here.id, ()), key=lambda link: abs(link.turn_rad))
        if turn is not None and not ahead:
            links = [link for link in links if _turns(link, turn)]
            if not links:
                raise ConfigError(field, turn, f"a turn that lane {lane.id!r} leads to")
        links = [link for link in links if link.target.edge not in been]
        if not links:
            break
        here = links[0].target
        ahead.append(here.edge)
        length_m += links[0].inside_m + here.length_m
    lanes, back = [lane], list[Link]()
    while sum(one.length_m for one in lanes[:-1]) + reference_m < BACK_M:
        been = {*ahead, *(one.edge for one in lanes)}
        arriving = [link for link in net.back.get(lanes[0].id, ()) if link.source.edge not in been]
        if not arriving or any(link.signal for link in arriving):  # who starts before a signal may stand there for good
            break
        back.insert(0, min(arriving, key=lambda link: abs(link.turn_rad)))
        lanes.insert(0, back[0].source)
    return _track(lanes, back, len(lanes) - 1, reference_m, *_ahead(net, lane, ahead, ahead))


def _ahead(
    net: Net, lane: NetLane, edges: Sequence[str], route: Sequence[str]
) -> tuple[list[NetLane], list[Link], list[str]]:
    """Follows lanes without lane changes; returns lanes, links and the edges left.

    `route` has each of the `edges` as an edge, or as the lane to take.
    """
    lanes, links = [lane], list[Link]()
    for edge, item in zip(edges, route, strict=True):
        on = [link for link in _links_to(net, lanes[-1], edge) if item in (edge, link.target.id)]
        if not on:
            break
        links.append(on[0])
        lanes.append(on[0].target)
    return lanes[1:], links, list(edges[len(links) :])


def _track(
    lanes: list[NetLane],
    links: list[Link],
    own: int,
    reference_m: float,
    ahead: list[NetLane],
    on: list[Link],
    onward: list[str],
) -> Track:
    return Track(pieces_of([*lanes, *ahead], [*links, *on], own, reference_m), tuple(onward))


def pieces_of(lanes: Sequence[NetLane], links: Sequence[Link], own: int, reference_m: float) -> tuple[Piece, ...]:
    """Returns the pieces of lanes and the links between them.

    The reference is on lane `own`, m from its beginning.
    """
    reach_m = [0.0] * len(lanes)
    reach_m[own] = reference_m
    for i in reversed(range(own)):
        reach_m[i] = reach_m[i + 1] + links[i].inside_m + lanes[i].length_m
    for i in range(own + 1, len(lanes)):
        reach_m[i] = reach_m[i - 1] - lanes[i - 1].length_m - links[i - 1].inside_m
    return tuple(
        Piece(lane.edge, lane.index, round(reach, 2), lane.length_m, lane.limit_mps)
        for lane, reach in zip(lanes, reach_m, strict=True)
    )
