"""Layout: plain data of all actors' starts, between a scene and a simulator."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal

from risk_sac.scenario.ground import Area, areas
from risk_sac.scenario.place import Ground, Place, Track, Walk
from risk_sac.types import Role

LEAD_IN_S = 1.5  # in which SUMO drives all vehicles, before the adversaries are released to the policy
Body = Literal["car", "truck"]
CAR_LENGTH_M, CAR_WIDTH_M = 4.6, 1.85  # as `sumo_nets/vtypes.add.xml` has it
TRUCK_LENGTH_M, TRUCK_WIDTH_M = 8.0, 2.4


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleStart:
    """A vehicle on its route's first edge."""

    id: str
    role: Role
    route: tuple[str, ...]  # edges of the net
    lane: int  # index on the first edge, 0 is the rightmost
    position_m: float  # of the front bumper along the first edge
    speed_mps: float
    body: Body = "car"


@dataclass(frozen=True, slots=True, kw_only=True)
class PedestrianStart:
    """A pedestrian anywhere in the plane."""

    id: str
    role: Role
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Everything a simulator needs to set up one episode."""

    net: str  # file below sumo_nets/, or anywhere
    ego: VehicleStart
    vehicles: tuple[VehicleStart, ...]
    pedestrians: tuple[PedestrianStart, ...] = ()
    crossings: tuple[Area, ...] = ()  # pedestrian crossings, where drivers yield
    roadway: tuple[Area, ...] = ()  # where vehicles drive, as far as pedestrians may get there
    junctions: tuple[Area, ...] = ()  # where the ways of vehicles cross
    lane_width_m: float = 3.3
    signal: str | None = None  # id of the traffic light
    signal_offset_s: float = 0.0  # where in its cycle the episode starts
    friction: float = 1.0
    wary: bool = False  # whether drivers stop for an ego that stands askew; SUMO tells them of a box along its lane


def layout_at(
    place: Place,
    xi: Mapping[str, float],
    ego: VehicleStart,
    vehicles: Iterable[VehicleStart],
    pedestrians: tuple[PedestrianStart, ...] = (),
) -> Layout:
    """The layout of a scene at a place, given where its actors start."""
    crossings, roadway, junctions = _areas(place.ground)
    return Layout(
        net=place.net,
        ego=ego,
        vehicles=tuple(vehicles),
        pedestrians=pedestrians,
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
    """A vehicle whose front is `before_m` before its track's reference once the adversaries are released.

    Until then it drives `lead_m`; if that is not given, it keeps its speed.
    """
    route, piece, position_m = track.start(before_m, LEAD_IN_S * speed_mps if lead_m is None else lead_m)
    return VehicleStart(
        id=id_,
        role=role,
        route=route,
        lane=piece.lane,
        position_m=position_m,
        speed_mps=min(speed_mps, piece.limit_mps),  # SUMO refuses a faster start
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


@cache  # every episode asks for it
def _areas(ground: Ground) -> tuple[tuple[Area, ...], tuple[Area, ...], tuple[Area, ...]]:
    return areas(ground.crossings), areas(ground.roadway), areas(ground.junctions)
