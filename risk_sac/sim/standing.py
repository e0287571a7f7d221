"""Static bodies that stand in a lane, as SUMO's drivers see them.

A static body is no vehicle of SUMO's: its place is the layout's, exactly, and drivers stop for it as for a pedestrian
(`risk_sac.sim.lookout`). One that stands along a lane gets a stand-in there, so that SUMO's lane-change models know of
it and drivers pass it. The stand-in is never read.
"""

import math
from collections.abc import Iterable

import libsumo

from risk_sac.scenario.layout import StaticStart
from risk_sac.sim.paths import CAR, car_may_use
from risk_sac.sim.roads import KEEP_ROUTE

LEAST_M = 0.05  # of a body's width in the lane; less hinders no vehicle
ALONG_RAD = 0.35  # greatest angle to the lane of a body that a stand-in along the lane can stand for; choice


def stand_in_lanes(statics: Iterable[StaticStart]) -> frozenset[str]:
    """Inserts the stand-ins of static bodies, and returns the ids of those that have one."""
    return frozenset(start.id for start in statics if _stand_in(start))


def _stand_in(start: StaticStart) -> bool:
    """Inserts a stand-in if the body reaches into a lane, and lies along it."""
    body = start.shape
    edge, centre_m, index = libsumo.simulation.convertRoad(start.x_m, start.y_m, False, CAR)
    lane = f"{edge}_{index}"
    if not edge or edge.startswith(":"):
        return False
    x, y = libsumo.simulation.convert2D(edge, centre_m, index)
    way_rad = math.radians(90.0 - libsumo.lane.getAngle(lane, centre_m))
    dx, dy = start.x_m - x, start.y_m - y
    right_m, left_m = _inside(edge, index, dy * math.cos(way_rad) - dx * math.sin(way_rad), body.width_m / 2)
    front_m = centre_m + body.length_m / 2
    inside = left_m - right_m > LEAST_M and body.length_m < front_m < libsumo.lane.getLength(lane)
    if not inside or abs(math.sin(start.heading_rad - way_rad)) > math.sin(ALONG_RAD):
        return False
    route = f"stands_{edge}"
    if route not in libsumo.route.getIDList():
        libsumo.route.add(route, [edge])
    vehicle, offset_m = libsumo.vehicle, (right_m + left_m) / 2
    vehicle.add(start.id, route, "background_car", departLane=str(index), departPos=repr(front_m), departSpeed="0")
    vehicle.setLength(start.id, body.length_m)
    vehicle.setWidth(start.id, left_m - right_m)
    vehicle.setSpeed(start.id, 0.0)
    vehicle.setLaneChangeMode(start.id, 0)
    x, y = x + (body.length_m / 2) * math.cos(way_rad), y + (body.length_m / 2) * math.sin(way_rad)
    x, y = x - offset_m * math.sin(way_rad), y + offset_m * math.cos(way_rad)
    vehicle.moveToXY(start.id, edge, index, x, y, keepRoute=KEEP_ROUTE)
    return True


def _inside(edge: str, index: int, offset_m: float, half_m: float) -> tuple[float, float]:
    """Returns the right and left end of a body across its lane, without what is beside the carriageway."""
    lane_m, lanes = libsumo.lane.getWidth(f"{edge}_{index}") / 2, libsumo.edge.getLaneNumber(edge)
    drivable = [0 <= beside < lanes and car_may_use(f"{edge}_{beside}") for beside in (index - 1, index + 1)]
    right_m, left_m = offset_m - half_m, offset_m + half_m
    return right_m if drivable[0] else max(right_m, -lane_m), left_m if drivable[1] else min(left_m, lane_m)
