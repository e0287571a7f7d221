"""Car following, the family `low`: a leader and two neighbours on a straight three-lane road.

Source: RISK-SAC, Sec. IV-A.2. Coordinates are those of the net in `sumo_nets/low/`.
"""

from collections.abc import Mapping

from risk_sac.scenario.family import EGO, Family, friction, initial_speed, road_odd
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.types import Role

VEHICLE_LENGTH_M = 4.6


def _layout(xi: Mapping[str, float]) -> Layout:
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
            initial_speed("ego_speed_mps", 8, 16.6, "initial speed of the ego"),
            Parameter("lead_gap_m", "m", 8, 50, "gap from the ego's front to the leader's rear"),
            initial_speed("lead_speed_mps", 6, 16.6, "initial speed of the leader"),
            Parameter("left_offset_m", "m", -15, 25, "left neighbour's front relative to the ego's"),
            initial_speed("left_speed_mps", 6, 16.6, "initial speed of the left neighbour"),
            Parameter("right_offset_m", "m", -15, 25, "right neighbour's front relative to the ego's"),
            initial_speed("right_speed_mps", 6, 16.6, "initial speed of the right neighbour"),
            Parameter("follower_gap_m", "m", 10, 40, "gap from the follower's front to the ego's rear"),
            friction(),
        ),
    ),
    odd=road_odd(lanes=3, limit_mps=16.67, signals=("none",), crossings=("none",)),
    vehicles=("lead", "left", "right"),
    pedestrians=(),
    layout=_layout,
)
