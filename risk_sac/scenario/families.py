"""The three scenario families: scene space, default ODD, and the layout a scene stands for.

Source: RISK-SAC, Sec. IV-A.2. Coordinates are those of the nets in `sumo_nets/`.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from risk_sac.config import CrossingType, DynamicElements, Environment, FamilyName, Interval, Odd, Scenery, SignalType
from risk_sac.scenario.layout import Area, Body, Layout, PedestrianStart, VehicleStart
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.types import Role

VEHICLE_LENGTH_M = 4.6
KERB_M = 6.55  # of the mixed road from its axis: two lanes of 3.3 m each, and 5 cm inside

LEAD_IN_S = 1.5  # in which SUMO drives everybody, before the adversaries are released to the policy

EGO = "ego"
LEFT, STRAIGHT, RIGHT = range(3)


@dataclass(frozen=True, slots=True)
class Family:
    """One scenario family."""

    name: FamilyName
    summary: str
    horizon_steps: int  # of 0.1 s
    space: SceneSpace
    odd: Odd  # complete: every field is set
    vehicles: tuple[str, ...]  # adversary vehicles, in the order of the action vector
    pedestrians: tuple[str, ...]  # adversary pedestrians, after the vehicles
    layout: Callable[[Mapping[str, float]], Layout]

    @property
    def adversaries(self) -> tuple[str, ...]:
        """All adversaries in the order of the action vector, two entries each."""
        return self.vehicles + self.pedestrians


def _friction() -> Parameter:
    return Parameter("friction", "1", 0.6, 1.0, "tyre-road friction coefficient", "environment.friction")


def _speed(name: str, low: float, high: float, meaning: str) -> Parameter:
    odd = "dynamic.ego_speed_mps" if name.startswith("ego") else "dynamic.vehicle_speed_mps"
    return Parameter(name, "m/s", low, high, meaning, odd)


def _walking(low: float, high: float) -> Parameter:
    return Parameter("pedestrian_speed_mps", "m/s", low, high, "initial walking speed", "dynamic.pedestrian_speed_mps")


def _odd(
    *, lanes: float, limit_mps: float, signals: tuple[SignalType, ...], crossings: tuple[CrossingType, ...]
) -> Odd:
    pedestrians = crossings != ("none",)
    return Odd(
        scenery=Scenery(
            lanes=Interval(low=lanes, high=lanes),
            speed_limit_mps=Interval(low=limit_mps, high=limit_mps),
            signal_types=signals,
            crossing_types=crossings,
        ),
        environment=Environment(friction=Interval(low=0.6, high=1.0), visibility_m=Interval(low=100, high=2000)),
        dynamic=DynamicElements(
            actor_kinds=("pedestrian", "vehicle") if pedestrians else ("vehicle",),
            ego_speed_mps=Interval(low=0, high=limit_mps),
            vehicle_speed_mps=Interval(low=0, high=limit_mps * 1.2),
            vehicle_accel_mps2=Interval(low=-8, high=3.5),
            vehicle_lateral_speed_mps=Interval(low=0, high=1.2),
            vehicle_lateral_accel_mps2=Interval(low=0, high=1.5),
            pedestrian_speed_mps=Interval(low=0, high=2),  # walking; who wants them to run says so
            pedestrian_accel_mps2=Interval(low=-1.5, high=1.5),
        ),
    )


def _low(xi: Mapping[str, float]) -> Layout:
    """Three lanes, ego in the middle; leader and both neighbours attack, two vehicles follow."""
    start = 200.0

    def car(id_: str, role: Role, lane: int, offset_m: float, speed_mps: float) -> VehicleStart:
        return VehicleStart(
            id=id_, role=role, route=("road",), lane=lane, position_m=start + offset_m, speed_mps=speed_mps
        )

    ego_speed = xi["ego_speed_mps"]
    return Layout(
        net="low/low.net.xml",
        ego=car(EGO, Role.EGO, 1, 0.0, ego_speed),
        vehicles=(
            car("lead", Role.ADVERSARY, 1, xi["lead_gap_m"] + VEHICLE_LENGTH_M, xi["lead_speed_mps"]),
            car("left", Role.ADVERSARY, 2, xi["left_offset_m"], xi["left_speed_mps"]),
            car("right", Role.ADVERSARY, 0, xi["right_offset_m"], xi["right_speed_mps"]),
            car("follower", Role.BACKGROUND, 1, -xi["follower_gap_m"] - VEHICLE_LENGTH_M, ego_speed),
            car("distant", Role.BACKGROUND, 1, xi["lead_gap_m"] + 60.0, xi["lead_speed_mps"]),
        ),
        friction=xi["friction"],
    )


LOW = Family(
    name="low",
    summary="Straight three-lane urban road: a lead vehicle and two neighbours brake, adapt speed and cut in.",
    horizon_steps=150,
    space=SceneSpace(
        "low",
        (
            _speed("ego_speed_mps", 8, 16.6, "initial speed of the ego"),
            Parameter("lead_gap_m", "m", 8, 50, "gap from the ego's front to the leader's rear"),
            _speed("lead_speed_mps", 6, 16.6, "initial speed of the leader"),
            Parameter("left_offset_m", "m", -15, 25, "left neighbour's front relative to the ego's"),
            _speed("left_speed_mps", 6, 16.6, "initial speed of the left neighbour"),
            Parameter("right_offset_m", "m", -15, 25, "right neighbour's front relative to the ego's"),
            _speed("right_speed_mps", 6, 16.6, "initial speed of the right neighbour"),
            Parameter("follower_gap_m", "m", 10, 40, "gap from the follower's front to the ego's rear"),
            _friction(),
        ),
    ),
    odd=_odd(lanes=3, limit_mps=16.67, signals=("none",), crossings=("none",)),
    vehicles=("lead", "left", "right"),
    pedestrians=(),
    layout=_low,
)


ZEBRA_M, SIGNAL_M = 300.0, 700.0  # centres of the two crossings on the mixed road
CROSSING_HALF_WIDTH_M = 2.0


def _mixed(xi: Mapping[str, float]) -> Layout:
    """Ego in the left of two lanes, an occluder in the right one, a pedestrian at the right kerb (Fig. 2)."""
    signalised = xi["crossing"] >= 0.5
    centre = SIGNAL_M if signalised else ZEBRA_M
    edge, after, start = ("e2", "e3", 302.0) if signalised else ("e1", "e2", 0.0)
    stop_line = centre - CROSSING_HALF_WIDTH_M - start
    oncoming_edge, oncoming_after, oncoming_length = ("w3", "w2", 298.0) if signalised else ("w2", "w1", 396.0)

    def car(id_: str, role: Role, lane: int, before_m: float, speed_mps: float, body: Body = "car") -> VehicleStart:
        return VehicleStart(
            id=id_,
            role=role,
            route=(edge, after),
            lane=lane,
            position_m=stop_line - before_m - LEAD_IN_S * speed_mps,
            speed_mps=speed_mps,
            body=body,
        )

    return Layout(
        net="mixed/mixed.net.xml",
        ego=car(EGO, Role.EGO, 2, xi["ego_distance_m"], xi["ego_speed_mps"]),
        vehicles=(
            car("occluder", Role.ADVERSARY, 1, xi["occluder_distance_m"], xi["occluder_speed_mps"], "truck"),
            car("follower", Role.BACKGROUND, 2, xi["ego_distance_m"] + 25.0, xi["ego_speed_mps"]),
            *(
                VehicleStart(
                    id=f"oncoming_{i}",
                    role=Role.BACKGROUND,
                    route=(oncoming_edge, oncoming_after),
                    lane=1 + i % 2,
                    position_m=oncoming_length - 60.0 - 30.0 * i,
                    speed_mps=10.0,
                )
                for i in range(4)
            ),
        ),
        pedestrians=(
            PedestrianStart(
                id="pedestrian",
                role=Role.ADVERSARY,
                x_m=centre + xi["pedestrian_offset_m"],
                y_m=-KERB_M - xi["pedestrian_setback_m"] - LEAD_IN_S * xi["pedestrian_speed_mps"],
                heading_rad=math.pi / 2,
                speed_mps=xi["pedestrian_speed_mps"],
            ),
        ),
        crossings=tuple(
            Area(c - CROSSING_HALF_WIDTH_M, c + CROSSING_HALF_WIDTH_M, -KERB_M, KERB_M) for c in (ZEBRA_M, SIGNAL_M)
        ),
        roadway=(Area(0.0, 1000.0, -KERB_M, KERB_M),),
        signal="signal",
        signal_offset_s=xi["signal_offset_s"],
        friction=xi["friction"],
    )


MIXED = Family(
    name="mixed",
    summary="Zebra or signalised crossing: a pedestrian steps out from behind a vehicle in the adjacent lane.",
    horizon_steps=150,
    space=SceneSpace(
        "mixed",
        (
            Parameter(
                "crossing",
                "1",
                0,
                1,
                "zebra below 0.5, signalised from 0.5",
                "scenery.crossing_types",
                ("zebra", "signalised"),
            ),
            _speed("ego_speed_mps", 6, 13.8, "initial speed of the ego"),
            Parameter("ego_distance_m", "m", 25, 90, "ego's front to the crossing's near edge"),
            Parameter("occluder_distance_m", "m", 0.5, 25, "occluder's front to the crossing's near edge"),
            _speed("occluder_speed_mps", 0, 12, "initial speed of the occluder"),
            Parameter("pedestrian_offset_m", "m", -1.9, 1.9, "pedestrian along the road from the crossing's axis"),
            Parameter("pedestrian_setback_m", "m", 0.3, 5, "pedestrian's distance from the kerb"),
            _walking(0, 2.0),
            Parameter("signal_offset_s", "s", 0, 38, "position in the signal's cycle at the start"),
            _friction(),
        ),
    ),
    odd=_odd(lanes=2, limit_mps=13.89, signals=("fixed_time", "none"), crossings=("signalised", "zebra")),
    vehicles=("occluder",),
    pedestrians=("pedestrian",),
    layout=_mixed,
)


APPROACH_M = 230.4  # length of each approach of the dense intersection
DENSE_KERB_M = 8.05  # of its roads from their axis: half the median, two lanes, and 5 cm inside
NEAR_M, FAR_M = 15.6, 19.6  # its crossings' edges from the centre
CORNER_M = 10.5  # half the square in the middle of the intersection that turning vehicles sweep
_LEG_AFTER = {
    "south": ("west", "north", "east"),  # destination after a left turn, straight on, a right turn
    "north": ("east", "south", "west"),
    "west": ("north", "east", "south"),
    "east": ("south", "west", "north"),
}


def _turn(value: float) -> int:
    """Third of [0, 1] -> LEFT, STRAIGHT, RIGHT."""
    return min(int(value * 3), RIGHT)


def _approach(
    id_: str, role: Role, leg: str, turn: int, before_m: float, speed_mps: float, lane: int | None = None
) -> VehicleStart:
    return VehicleStart(
        id=id_,
        role=role,
        route=(f"from_{leg}", f"to_{_LEG_AFTER[leg][turn]}"),
        lane=lane or (1 if turn == RIGHT else 2),
        position_m=APPROACH_M - before_m - LEAD_IN_S * speed_mps,
        speed_mps=speed_mps,
    )


def _dense(xi: Mapping[str, float]) -> Layout:
    """Ego from the south; adversaries oncoming and from both sides, a pedestrian at the near crossing."""
    gap = xi["background_gap_m"]
    background = [
        _approach(f"{leg}_{i}", Role.BACKGROUND, leg, STRAIGHT, before_m, 9.0, lane=1)
        for leg in ("north", "west", "east", "south")
        for i, before_m in enumerate((30.0 + gap, 30.0 + 2 * gap))
    ]
    return Layout(
        net="dense/dense.net.xml",
        ego=_approach(EGO, Role.EGO, "south", _turn(xi["ego_turn"]), xi["ego_distance_m"], xi["ego_speed_mps"]),
        vehicles=(
            _approach(
                "oncoming",
                Role.ADVERSARY,
                "north",
                _turn(xi["oncoming_turn"]),
                xi["oncoming_distance_m"],
                xi["oncoming_speed_mps"],
            ),
            _approach(
                "from_left",
                Role.ADVERSARY,
                "west",
                _turn(xi["from_left_turn"]),
                xi["from_left_distance_m"],
                xi["from_left_speed_mps"],
            ),
            _approach(
                "from_right",
                Role.ADVERSARY,
                "east",
                _turn(xi["from_right_turn"]),
                xi["from_right_distance_m"],
                xi["from_right_speed_mps"],
            ),
            *background,
        ),
        pedestrians=(
            PedestrianStart(
                id="pedestrian",
                role=Role.ADVERSARY,
                x_m=DENSE_KERB_M + xi["pedestrian_setback_m"] + LEAD_IN_S * xi["pedestrian_speed_mps"],
                y_m=-(NEAR_M + FAR_M) / 2 + xi["pedestrian_offset_m"],
                heading_rad=math.pi,
                speed_mps=xi["pedestrian_speed_mps"],
            ),
        ),
        crossings=(
            Area(-DENSE_KERB_M, DENSE_KERB_M, NEAR_M, FAR_M),
            Area(-DENSE_KERB_M, DENSE_KERB_M, -FAR_M, -NEAR_M),
            Area(NEAR_M, FAR_M, -DENSE_KERB_M, DENSE_KERB_M),
            Area(-FAR_M, -NEAR_M, -DENSE_KERB_M, DENSE_KERB_M),
        ),
        roadway=(
            Area(-DENSE_KERB_M, DENSE_KERB_M, -250.0, 250.0),
            Area(-250.0, 250.0, -DENSE_KERB_M, DENSE_KERB_M),
            Area(-CORNER_M, CORNER_M, -CORNER_M, CORNER_M),
        ),
        junctions=(Area(-NEAR_M, NEAR_M, -NEAR_M, NEAR_M),),
        signal="centre",
        signal_offset_s=xi["signal_offset_s"],
        friction=xi["friction"],
    )


def _dense_approach(name: str, who: str) -> tuple[Parameter, ...]:
    turn = Parameter(f"{name}_turn", "1", 0, 1, f"{who} turns left below 1/3, right above 2/3, else goes straight")
    distance = Parameter(f"{name}_distance_m", "m", 10, 90, f"{who}'s front to its stop line")
    return turn, distance, _speed(f"{name}_speed_mps", 5, 13.8, f"initial speed of {who}")


DENSE = Family(
    name="dense",
    summary="Signalised four-leg intersection: turning and crossing vehicles, background traffic, a pedestrian.",
    horizon_steps=150,
    space=SceneSpace(
        "dense",
        (
            *_dense_approach("ego", "the ego"),
            *_dense_approach("oncoming", "the oncoming vehicle"),
            *_dense_approach("from_left", "the vehicle from the left"),
            *_dense_approach("from_right", "the vehicle from the right"),
            Parameter("pedestrian_offset_m", "m", -1.9, 1.9, "pedestrian across the near crossing's axis"),
            Parameter("pedestrian_setback_m", "m", 0.3, 5, "pedestrian's distance from the kerb"),
            _walking(0, 2.0),
            Parameter("background_gap_m", "m", 15, 40, "spacing of the background vehicles"),
            Parameter("signal_offset_s", "s", 0, 56, "position in the signal's cycle at the start"),
            _friction(),
        ),
    ),
    odd=_odd(lanes=2, limit_mps=13.89, signals=("fixed_time",), crossings=("signalised",)),
    vehicles=("oncoming", "from_left", "from_right"),
    pedestrians=("pedestrian",),
    layout=_dense,
)

FAMILIES: dict[str, Family] = {family.name: family for family in (LOW, MIXED, DENSE)}
