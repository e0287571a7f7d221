"""Where everybody starts: the plain data between a scene and a simulator."""

from dataclasses import dataclass
from typing import Literal

from risk_sac.scenario.ground import Area
from risk_sac.types import Role

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
