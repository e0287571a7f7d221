"""Finds lanes for car following.

Such a lane can be driven on for an episode, and has room behind the ego.
"""

from collections.abc import Iterator
from contextlib import suppress

from risk_sac.maps.cut import signal_of
from risk_sac.maps.found import NoFit, Spot, lacking
from risk_sac.maps.ways import DRIVEN_S, PIECES_M, LaneWay, track, way_on
from risk_sac.scenario.car_following import LEAST_BEHIND_M
from risk_sac.scenario.place import Stretch, Track
from risk_sac.world.net import Edge, Link, Net, NetLane

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


def place(net: Net, spot: Spot) -> Stretch:
    """Car following on a road; raises `NoFit` where it has no room."""
    edge = net.edges[spot.id]
    check_limit(edge.drivable[0])
    reference_m = round(edge.drivable[0].length_m / 2, 2)
    own, way = _lane_to_drive(net, edge, reference_m)
    ego = track(net, way, reference_m, PIECES_M)
    if ego.room_m < LEAST_BEHIND_M:
        raise NoFit(f"the room behind the ego is {lacking(ego.room_m, 'm', LEAST_BEHIND_M)}")
    signals = [link.signal for link in _soon(way, own.length_m - reference_m)]
    sides = {lane.index - own.index: _beside(net, lane, reference_m) for lane in edge.drivable}
    beside = ["left"] * (sides.get(1) is not None) + ["right"] * (sides.get(-1) is not None)
    return Stretch(
        net="",
        summary=f"Car following on {edge.id!r}: who is ahead{' and ' + ' and '.join(beside) if beside else ''} brakes, "
        f"adapts speed{' and cuts in' if beside else ''}.",
        lanes=len(edge.drivable),
        speed_limit_mps=own.limit_mps,
        lane_width_m=own.width_m,
        signal=signal_of(net, signals),
        ego=ego,
        left=sides.get(1),
        right=sides.get(-1),
    )


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


def _beside(net: Net, lane: NetLane, reference_m: float) -> Track | None:
    with suppress(NoFit):
        way = way_on(net, lane, BESIDE_S, from_m=reference_m)
        found = track(net, way, reference_m, PIECES_M)
        return found if found.room_m >= LEAST_BEHIND_M else None
    return None


def _soon(way: LaneWay, left_m: float) -> list[Link]:
    links, gone_s = list[Link](), left_m / way.lanes[0].limit_mps
    for link, lane in zip(way.links, way.lanes[1:], strict=True):
        if gone_s > SIGNAL_S:
            break
        links.append(link)
        gone_s += lane.length_m / lane.limit_mps
    return links
