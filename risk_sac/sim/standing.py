"""Static bodies that stand in a lane, as SUMO's drivers see them.

A static body is no vehicle of SUMO's: its place is the layout's, exactly, and drivers stop for it as for a pedestrian
(`risk_sac.sim.lookout`). One that stands along a lane gets a stand-in there, so that SUMO's lane-change models know of
it and drivers pass it. The stand-in is never read.
"""

import math
from collections.abc import Iterable

import libsumo

from risk_sac.scenario.bodies import BODIES
from risk_sac.scenario.layout import StaticStart

KEEP_ROUTE = 1  # of SUMO's `moveToXY`: the nearest place on the route
ALONG_RAD = 0.35  # greatest angle to the lane of a body that a stand-in along the lane can stand for; choice


def stand_in_lanes(statics: Iterable[StaticStart]) -> frozenset[str]:
    """Inserts the stand-ins of static bodies, and returns the ids of those that have one."""
    return frozenset(start.id for start in statics if _stand_in(start))


def _stand_in(start: StaticStart) -> bool:
    """Inserts a stand-in if the body's centre is in a lane, and the body along it."""
    body = BODIES[start.body]
    edge, centre_m, index = libsumo.simulation.convertRoad(start.x_m, start.y_m, False, "passenger")
    lane = f"{edge}_{index}"
    if not edge or edge.startswith(":"):
        return False
    x, y = libsumo.simulation.convert2D(edge, centre_m, index)
    way_rad = math.radians(90.0 - libsumo.lane.getAngle(lane, centre_m))
    dx, dy = start.x_m - x, start.y_m - y
    offset_m = dy * math.cos(way_rad) - dx * math.sin(way_rad)
    front_m = centre_m + body.length_m / 2
    inside = abs(offset_m) <= libsumo.lane.getWidth(lane) / 2 and body.length_m < front_m < libsumo.lane.getLength(lane)
    if not inside or abs(math.sin(start.heading_rad - way_rad)) > math.sin(ALONG_RAD):
        return False
    route = f"stands_{edge}"
    if route not in libsumo.route.getIDList():
        libsumo.route.add(route, [edge])
    vehicle = libsumo.vehicle
    vehicle.add(
        start.id,
        route,
        typeID="background_car",
        departLane=str(index),
        departPos=repr(front_m),
        departSpeed="0",
    )
    vehicle.setLength(start.id, body.length_m)
    vehicle.setWidth(start.id, body.width_m)
    vehicle.setSpeed(start.id, 0.0)
    vehicle.setLaneChangeMode(start.id, 0)
    x, y = x + (body.length_m / 2) * math.cos(way_rad), y + (body.length_m / 2) * math.sin(way_rad)
    x, y = x - offset_m * math.sin(way_rad), y + offset_m * math.cos(way_rad)
    vehicle.moveToXY(start.id, edge, index, x, y, keepRoute=KEEP_ROUTE)
    return True
