"""A junction, the family `dense`: turning and crossing vehicles and a pedestrian at a signalised intersection.

Source: RISK-SAC, Sec. IV-A.2. Coordinates are those of the net in `sumo_nets/dense/`.
"""

import math
from collections.abc import Mapping

from risk_sac.scenario.family import EGO, LEAD_IN_S, Family, friction, initial_speed, road_odd, walking_speed
from risk_sac.scenario.layout import Area, Layout, PedestrianStart, VehicleStart
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.types import Role

LEFT, STRAIGHT, RIGHT = range(3)
APPROACH_M = 230.4  # length of each approach
KERB_M = 8.05  # of its roads from their axis: half the median, two lanes, and 5 cm inside
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


def _layout(xi: Mapping[str, float]) -> Layout:
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
                x_m=KERB_M + xi["pedestrian_setback_m"] + LEAD_IN_S * xi["pedestrian_speed_mps"],
                y_m=-(NEAR_M + FAR_M) / 2 + xi["pedestrian_offset_m"],
                heading_rad=math.pi,
                speed_mps=xi["pedestrian_speed_mps"],
            ),
        ),
        crossings=(
            Area(-KERB_M, KERB_M, NEAR_M, FAR_M),
            Area(-KERB_M, KERB_M, -FAR_M, -NEAR_M),
            Area(NEAR_M, FAR_M, -KERB_M, KERB_M),
            Area(-FAR_M, -NEAR_M, -KERB_M, KERB_M),
        ),
        roadway=(
            Area(-KERB_M, KERB_M, -250.0, 250.0),
            Area(-250.0, 250.0, -KERB_M, KERB_M),
            Area(-CORNER_M, CORNER_M, -CORNER_M, CORNER_M),
        ),
        junctions=(Area(-NEAR_M, NEAR_M, -NEAR_M, NEAR_M),),
        signal="centre",
        signal_offset_s=xi["signal_offset_s"],
        friction=xi["friction"],
    )


def _approach_parameters(name: str, who: str) -> tuple[Parameter, ...]:
    turn = Parameter(f"{name}_turn", "1", 0, 1, f"{who} turns left below 1/3, right above 2/3, else goes straight")
    distance = Parameter(f"{name}_distance_m", "m", 10, 90, f"{who}'s front to its stop line")
    return turn, distance, initial_speed(f"{name}_speed_mps", 5, 13.8, f"initial speed of {who}")


DENSE = Family(
    name="dense",
    summary="Signalised four-leg intersection: turning and crossing vehicles, background traffic, a pedestrian.",
    horizon_steps=150,
    space=SceneSpace(
        "dense",
        (
            *_approach_parameters("ego", "the ego"),
            *_approach_parameters("oncoming", "the oncoming vehicle"),
            *_approach_parameters("from_left", "the vehicle from the left"),
            *_approach_parameters("from_right", "the vehicle from the right"),
            Parameter("pedestrian_offset_m", "m", -1.9, 1.9, "pedestrian across the near crossing's axis"),
            Parameter("pedestrian_setback_m", "m", 0.3, 5, "pedestrian's distance from the kerb"),
            walking_speed(0, 2.0),
            Parameter("background_gap_m", "m", 15, 40, "spacing of the background vehicles"),
            Parameter("signal_offset_s", "s", 0, 56, "position in the signal's cycle at the start"),
            friction(),
        ),
    ),
    odd=road_odd(lanes=2, limit_mps=13.89, signals=("fixed_time",), crossings=("signalised",)),
    vehicles=("oncoming", "from_left", "from_right"),
    pedestrians=("pedestrian",),
    layout=_layout,
)
