"""A hidden pedestrian, the family `mixed`: a crossing, and a vehicle that stands between who walks and who drives.

Source: RISK-SAC, Sec. IV-A.2. Coordinates are those of the net in `sumo_nets/mixed/`.
"""

import math
from collections.abc import Mapping

from risk_sac.scenario.family import EGO, LEAD_IN_S, Family, friction, initial_speed, road_odd, walking_speed
from risk_sac.scenario.layout import Area, Body, Layout, PedestrianStart, VehicleStart
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.types import Role

KERB_M = 6.55  # of the road from its axis: two lanes of 3.3 m each, and 5 cm inside
ZEBRA_M, SIGNAL_M = 300.0, 700.0  # centres of the two crossings on the mixed road
CROSSING_HALF_WIDTH_M = 2.0


def _layout(xi: Mapping[str, float]) -> Layout:
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
            initial_speed("ego_speed_mps", 6, 13.8, "initial speed of the ego"),
            Parameter("ego_distance_m", "m", 25, 90, "ego's front to the crossing's near edge"),
            Parameter("occluder_distance_m", "m", 0.5, 25, "occluder's front to the crossing's near edge"),
            initial_speed("occluder_speed_mps", 0, 12, "initial speed of the occluder"),
            Parameter("pedestrian_offset_m", "m", -1.9, 1.9, "pedestrian along the road from the crossing's axis"),
            Parameter("pedestrian_setback_m", "m", 0.3, 5, "pedestrian's distance from the kerb"),
            walking_speed(0, 2.0),
            Parameter("signal_offset_s", "s", 0, 38, "position in the signal's cycle at the start"),
            friction(),
        ),
    ),
    odd=road_odd(lanes=2, limit_mps=13.89, signals=("fixed_time", "none"), crossings=("signalised", "zebra")),
    vehicles=("occluder",),
    pedestrians=("pedestrian",),
    layout=_layout,
)
