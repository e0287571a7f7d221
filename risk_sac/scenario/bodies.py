"""Table of road users' bodies: size, motion, injury, picture and exports.

A new body is one row here. SUMO's types of car and truck are in `sumo_nets/vtypes.add.xml`; those of other bodies
that move in lanes are copies of the car's with the row's size and driver. They are of the class passenger, so that
lanes for cars refuse no body: which lanes a body uses is the scenario's. One that starts on a lane without cars gets
its own class, and an adversary there one that SUMO refuses nowhere.

Sources of sizes: car, truck and pedestrian are choices of the shipped scenarios. Van, bus, motorcycle and bicycle have
the default sizes of SUMO's classes delivery, bus, motorcycle and bicycle (SUMO documentation, vehicle type parameter
defaults). The rest is choice, as all masses are: a kerb mass and a load.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal, NamedTuple, get_args

BodyName = Literal["car", "van", "truck", "bus", "motorcycle", "bicycle", "pedestrian", "child", "obstacle"]
Motion = Literal["lanes", "freely", "not"]
"""In lanes as a vehicle, anywhere in the plane as a pedestrian, or never."""
Injury = Literal["occupant", "pedestrian", "cyclist", "motorcyclist"]
"""The curve in `risk_sac.verdicts.labels` that decides a contact's severity."""
Shape = Literal["vehicle", "two_wheels", "person", "block"]


class BodyBound(NamedTuple):
    """Bound of one field of `Limits` under each behaviour, and its source."""

    ordinary: float
    emergency: float
    extreme: float
    source: str


class LaneDriver(NamedTuple):
    """Driver of a body that SUMO drives, in SUMO's terms."""

    accel_mps2: float
    decel_mps2: float
    emergency_mps2: float


CAR_DRIVER = LaneDriver(2.6, 4.5, 9.0)  # SUMO's class passenger


class ExportNames(NamedTuple):
    """Names of a body in other formats."""

    openscenario: str  # vehicleCategory, pedestrianCategory or miscObjectCategory
    commonroad: str  # type of a dynamic obstacle
    osi: int  # MovingObject.VehicleClassification.Type; 0 for what is no vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A kind of body that an actor has."""

    name: BodyName
    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    moves: tuple[Motion, ...]
    """Ways in which it may move; the first is the usual one."""
    conceals: bool
    """Whether what is behind it is hidden from a sensor."""
    lit: bool
    """Whether it carries lights, so that it is seen at night as far as by day."""
    injury: Injury
    shape: Shape
    """How it is drawn."""
    export: ExportNames
    sumo_class: str = "passenger"
    """Its class in permissions of lanes without cars."""
    driver: LaneDriver = CAR_DRIVER
    """As SUMO's class has it, where SUMO drives it."""
    limits: Mapping[str, BodyBound] = field(default_factory=dict)
    """Field of `Limits` → its bound; those of the ODD hold for the rest."""

    def sized(self, size_m: tuple[float, float] | None) -> "Body":
        """Returns the body with its own length and width; None: the usual."""
        return self if size_m is None else replace(self, length_m=size_m[0], width_m=size_m[1])

    @property
    def rides(self) -> bool:
        """Whether it has wheels and a rider, who is not inside it."""
        return self.shape == "two_wheels"

    @property
    def gait(self) -> Literal["walking", "riding"]:
        """Way of moving freely, which begins the names of its motion's features."""
        return "riding" if self.rides else "walking"


_SUMO = "default of SUMO's class {}; emergency: its emergencyDecel"
_BUS = {
    "accel_mps2": BodyBound(1.2, 1.2, 1.2, _SUMO.format("bus")),
    "brake_mps2": BodyBound(4.0, 7.0, 7.0, _SUMO.format("bus")),
}
_MOTORCYCLE = {
    "accel_mps2": BodyBound(3.0, 6.0, 6.0, "emergency: default of SUMO's class motorcycle; ordinary: choice")
}
_BICYCLE_MPS = BodyBound(
    25 / 3.6, 25 / 3.6, 45 / 3.6, "25 km/h: assistance of an EPAC ends (EN 15194); 45 km/h: class L1e-B (EU 168/2013)"
)
_BICYCLE = {
    "speed_mps": _BICYCLE_MPS,
    "accel_mps2": BodyBound(1.2, 1.2, 1.5, "default of SUMO's class bicycle; extreme: choice"),
    "brake_mps2": BodyBound(3.0, 5.0, 7.0, "default of SUMO's class bicycle, its emergencyDecel; emergency: choice"),
    "walk_speed_mps": _BICYCLE_MPS,
    "walk_accel_mps2": BodyBound(1.2, 1.2, 1.5, "default of SUMO's class bicycle; extreme: choice"),
    "walk_brake_mps2": BodyBound(3.0, 4.0, 5.0, "default of SUMO's class bicycle; emergency and extreme: choice"),
    "heading_rate_radps": BodyBound(1.0, 1.5, 1.5, "choice"),
    "walk_curvature_per_m": BodyBound(0.4, 0.5, 0.5, "choice: a turn of 2.5 m and 2 m radius"),
}
_CHILD = {
    "walk_speed_mps": BodyBound(2.0, 3.0, 4.0, "choice: a child runs where an adult walks"),
    "walk_accel_mps2": BodyBound(1.5, 2.0, 2.5, "choice"),
    "walk_brake_mps2": BodyBound(1.5, 2.0, 2.5, "choice"),
    "heading_rate_radps": BodyBound(1.5, 2.5, 2.5, "choice"),
}

_ROWS = (
    Body(
        name="car", length_m=4.6, width_m=1.85, height_m=1.5, mass_kg=1500.0, moves=("lanes", "not"), conceals=True,
        lit=True, injury="occupant", shape="vehicle", export=ExportNames("car", "car", 4),
    ),
    Body(
        name="van", length_m=6.5, width_m=2.16, height_m=2.86, mass_kg=2500.0, moves=("lanes", "not"), conceals=True,
        lit=True, injury="occupant", shape="vehicle", export=ExportNames("van", "car", 6),
        sumo_class="delivery",
    ),
    Body(
        name="truck", length_m=8.0, width_m=2.4, height_m=3.2, mass_kg=7500.0, moves=("lanes", "not"), conceals=True,
        lit=True, injury="occupant", shape="vehicle", export=ExportNames("truck", "truck", 7),
        sumo_class="truck",
    ),
    Body(
        name="bus", length_m=12.0, width_m=2.5, height_m=3.4, mass_kg=12000.0, moves=("lanes", "not"), conceals=True,
        lit=True, injury="occupant", shape="vehicle", export=ExportNames("bus", "bus", 12),
        sumo_class="bus", driver=LaneDriver(1.2, 4.0, 7.0), limits=_BUS,
    ),
    Body(
        name="motorcycle", length_m=2.2, width_m=0.9, height_m=1.5, mass_kg=280.0, moves=("lanes", "not"),
        conceals=False, lit=True, injury="motorcyclist", shape="two_wheels",
        export=ExportNames("motorbike", "motorcycle", 10), sumo_class="motorcycle",
        driver=LaneDriver(6.0, 10.0, 10.0), limits=_MOTORCYCLE,
    ),
    Body(
        name="bicycle", length_m=1.6, width_m=0.65, height_m=1.7, mass_kg=90.0, moves=("lanes", "freely", "not"),
        conceals=False, lit=True, injury="cyclist", shape="two_wheels",
        export=ExportNames("bicycle", "bicycle", 11), sumo_class="bicycle",
        driver=LaneDriver(1.2, 3.0, 7.0), limits=_BICYCLE,
    ),
    Body(
        name="pedestrian", length_m=0.5, width_m=0.5, height_m=1.75, mass_kg=75.0, moves=("freely", "not"),
        conceals=False, lit=False, injury="pedestrian", shape="person",
        export=ExportNames("pedestrian", "pedestrian", 0),
    ),
    Body(
        name="child", length_m=0.4, width_m=0.4, height_m=1.2, mass_kg=25.0, moves=("freely", "not"),
        conceals=False, lit=False, injury="pedestrian", shape="person",
        export=ExportNames("pedestrian", "pedestrian", 0), limits=_CHILD,
    ),
    Body(
        name="obstacle", length_m=1.0, width_m=1.0, height_m=1.0, mass_kg=1000.0, moves=("not",),
        conceals=False, lit=False, injury="occupant", shape="block",
        export=ExportNames("obstacle", "unknown", 0),
    ),
)  # fmt: skip
BODIES: Mapping[BodyName, Body] = MappingProxyType({row.name: row for row in _ROWS})
BODY_NAMES: tuple[BodyName, ...] = get_args(BodyName)
"""In the order of their codes in frames and recordings."""
CODES: Mapping[BodyName, int] = MappingProxyType({name: code for code, name in enumerate(BODY_NAMES)})


def body_of(code: int) -> Body:
    """Returns the body that a frame's or recording's code stands for."""
    return BODIES[BODY_NAMES[code]]


def body_like(length_m: float, width_m: float) -> Body:
    """Returns the body whose size comes nearest to a perceived one."""
    return min(BODIES.values(), key=lambda body: abs(body.length_m - length_m) + abs(body.width_m - width_m))
