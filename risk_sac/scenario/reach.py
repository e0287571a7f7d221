"""Whether an adversary can come near the ego's way within an episode."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np
import shapely
from shapely.ops import substring

from risk_sac.config.scenario import EGO
from risk_sac.scenario.bodies import BODIES
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.layout import Layout, PedestrianStart, VehicleStart
from risk_sac.scenario.limits import Limits
from risk_sac.world.net import Net
from risk_sac.world.types import STEP_S, Role

NEAR_M = 5.0  # between the middles of two ways on which bodies may touch; choice


def out_of_reach(layouts: Sequence[Layout], limits: Limits) -> list[str]:
    """Names of the adversaries that in no scene can come near the ego's way.

    A vehicle follows lanes, over any turn, as fast as it may; what moves freely goes straight there.

    Args:
      layouts: of scenes.
      limits: of adversaries, before those of their bodies.
    """
    reached: dict[str, bool] = {}
    for layout in layouts:
        net, horizon_s = net_of(layout.net), layout.horizon_steps * STEP_S
        ego_way = _way(net, layout.ego, layout.ego.route, horizon_s * limits.speed_mps)
        starts: tuple[VehicleStart | PedestrianStart, ...] = (*layout.vehicles, *layout.pedestrians)
        for start in starts:
            if start.role is not Role.ADVERSARY or reached.get(start.id):
                continue
            bounds = limits.of(BODIES[start.body])
            if isinstance(start, PedestrianStart):
                there = shapely.Point(start.x_m, start.y_m)
                reach_m = horizon_s * bounds.walk_speed_mps
            else:
                there = _anywhere(net, start, horizon_s * bounds.speed_mps)
                reach_m = 2 * NEAR_M if start.uses_oncoming else 0.0
            reached[start.id] = bool(ego_way.distance(there) <= reach_m + NEAR_M)
    return [name for name, near in reached.items() if not near and name != EGO]


def _way(net: Net, start: VehicleStart, route: Sequence[str], most_m: float) -> shapely.Geometry:
    """All lanes of a route from a start on, and the ways between them."""
    shapes = list(_rest(net, start, most_m))
    left_m = most_m - (net.edges[route[0]].lanes[0].length_m - start.position_m)
    for edge, following in pairwise(route):
        if left_m <= 0.0:
            break
        lanes = net.edges[edge].drivable
        links = [k for lane in lanes for k in net.onward.get(lane.id, ()) if k.target.edge == following]
        shapes += _lines(link.line for link in links)
        shapes += _lines(lane.line for lane in net.edges[following].drivable)
        left_m -= net.edges[following].lanes[0].length_m
    return shapely.union_all(shapes)


def _anywhere(net: Net, start: VehicleStart, most_m: float) -> shapely.Geometry:
    """All lanes that a vehicle may get to."""
    first = start.route[0]
    shapes, been = (
        list(_rest(net, start, most_m)),
        {first: most_m - net.edges[first].lanes[0].length_m + start.position_m},
    )
    waiting = [first]
    while waiting:
        edge = waiting.pop()
        for lane in net.edges[edge].drivable:
            for link in net.onward.get(lane.id, ()):
                following, left_m = link.target.edge, been[edge] - link.inside_m
                if been[edge] > 0.0:
                    shapes += _lines([link.line])
                if left_m > been.get(following, 0.0):
                    shapes += _lines(lane.line for lane in net.edges[following].drivable)
                    been[following] = left_m - net.edges[following].lanes[0].length_m
                    waiting.append(following)
    return shapely.union_all(shapes)


def _rest(net: Net, start: VehicleStart, most_m: float) -> Iterator[shapely.Geometry]:
    for lane in net.edges[start.route[0]].drivable:
        line = shapely.LineString(lane.line)
        yield substring(line, min(start.position_m, line.length), min(start.position_m + most_m, line.length))


def _lines(lines: Iterable[Sequence[tuple[float, float]]]) -> list[shapely.Geometry]:
    return [shapely.LineString(np.array(line)) for line in lines if len(line) > 1]
