"""Where everybody starts: the plain data between a scene and a simulator."""

from dataclasses import dataclass
from typing import Literal

from risk_sac.types import Role

Body = Literal["car", "truck"]


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


@dataclass(frozen=True, slots=True)
class Area:
    """An axis-aligned rectangle of ground."""

    x_low_m: float
    x_high_m: float
    y_low_m: float
    y_high_m: float

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether the point lies in the area."""
        return self.x_low_m <= x_m <= self.x_high_m and self.y_low_m <= y_m <= self.y_high_m

    def grown(self, by_m: float) -> "Area":
        """The area with a border added on every side."""
        return Area(self.x_low_m - by_m, self.x_high_m + by_m, self.y_low_m - by_m, self.y_high_m + by_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Everything a simulator needs to set up one episode."""

    net: str  # file below sumo_nets/
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
