"""From a place and a scene to the plain data of a layout, the same for all patterns."""

import math
from collections.abc import Mapping
from functools import cache
from typing import TypedDict

from risk_sac.scenario.family import LEAD_IN_S
from risk_sac.scenario.ground import Area, areas
from risk_sac.scenario.layout import Body, PedestrianStart, VehicleStart
from risk_sac.scenario.place import CrossingPlace, Ground, JunctionPlace, Stretch, Track, Walk
from risk_sac.types import Role


class Surroundings(TypedDict):
    """What a layout says of a place, whoever starts there."""

    net: str
    crossings: tuple[Area, ...]
    roadway: tuple[Area, ...]
    junctions: tuple[Area, ...]
    lane_width_m: float
    signal: str | None
    signal_offset_s: float
    friction: float
    wary: bool


def surroundings(place: Stretch | CrossingPlace | JunctionPlace, xi: Mapping[str, float]) -> Surroundings:
    """The fields of a layout that do not say where anybody starts."""
    crossings, roadway, junctions = _areas(place.ground)
    return Surroundings(
        net=place.net,
        crossings=crossings,
        roadway=roadway,
        junctions=junctions,
        lane_width_m=place.lane_width_m,
        signal=None if place.signal is None else place.signal.id,
        signal_offset_s=xi.get("signal_offset_s", 0.0),
        friction=xi["friction"],
        wary=place.wary,
    )


def vehicle(
    id_: str,
    role: Role,
    track: Track,
    before_m: float,
    speed_mps: float,
    lead_m: float | None = None,
    body: Body = "car",
) -> VehicleStart:
    """A vehicle `before_m` before the reference of its track once the adversaries are released.

    Args:
      id_: its name.
      role: who drives it.
      track: its way.
      before_m: of its front bumper; negative beyond the reference.
      speed_mps: at the start, and on until the release.
      lead_m: what it drives until the release; at its speed if not given.
      body: its size.
    """
    route, piece, position_m = track.start(before_m, LEAD_IN_S * speed_mps if lead_m is None else lead_m)
    return VehicleStart(
        id=id_,
        role=role,
        route=route,
        lane=piece.lane,
        position_m=position_m,
        speed_mps=min(speed_mps, piece.limit_mps),  # SUMO refuses who would begin faster
        body=body,
    )


def pedestrian(walk: Walk, xi: Mapping[str, float]) -> PedestrianStart:
    """A pedestrian at the kerb, and further along the road by the offset."""
    along_x, along_y, offset_m = walk.along_x, walk.along_y, xi["pedestrian_offset_m"]
    setback_m, lead_m = xi["pedestrian_setback_m"], LEAD_IN_S * xi["pedestrian_speed_mps"]
    return PedestrianStart(
        id="pedestrian",
        role=Role.ADVERSARY,
        x_m=walk.x_m - along_x * setback_m - along_x * lead_m + along_y * offset_m,
        y_m=walk.y_m - along_y * setback_m - along_y * lead_m - along_x * offset_m,
        heading_rad=math.atan2(along_y, along_x),
        speed_mps=xi["pedestrian_speed_mps"],
    )


@cache  # an episode asks for the ground anew, and it stays as it is
def _areas(ground: Ground) -> tuple[tuple[Area, ...], tuple[Area, ...], tuple[Area, ...]]:
    return areas(ground.crossings), areas(ground.roadway), areas(ground.junctions)
