"""Car following: a leader and neighbours brake, adapt their speed and cut in.

A neighbour is on either side where there is a lane.

Source: RISK-SAC, Sec. IV-A.2.
"""

from collections.abc import Mapping

from risk_sac.scenario.family import EGO, Family, at_most, friction, initial_speed, offset_of, road_odd
from risk_sac.scenario.layout import CAR_LENGTH_M, Layout, VehicleStart, layout_at, vehicle
from risk_sac.scenario.place import Stretch, Track
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.world.types import Role

BEHIND_M, AHEAD_M = 15.0, 25.0  # range of the neighbours' fronts relative to the ego's
LEAST_FOLLOWING_M, MOST_FOLLOWING_M = 10.0, 40.0  # range of the gap behind the ego
CLEAR_M = 1.0  # length that a track has left behind the last vehicle on it
DISTANT_M = 60.0  # distance of the distant vehicle beyond the leader
LEAST_BEHIND_M = 8.0  # room that a place must have behind the ego


def family(name: str, place: Stretch) -> Family:
    """The family that this pattern is at a place."""
    followed = place.ego.room_m >= LEAST_FOLLOWING_M + 2 * CAR_LENGTH_M + CLEAR_M
    beside = {side: track for side, track in (("left", place.left), ("right", place.right)) if track is not None}

    def layout(xi: Mapping[str, float]) -> Layout:
        ego_speed = xi["ego_speed_mps"]

        def car(id_: str, role: Role, track: Track, ahead_m: float, speed_mps: float) -> VehicleStart:
            return vehicle(id_, role, track, -ahead_m, speed_mps, lead_m=0.0)

        lead_m = xi["lead_gap_m"] + CAR_LENGTH_M
        vehicles = [car("lead", Role.ADVERSARY, place.ego, lead_m, xi["lead_speed_mps"])]
        for side, track in beside.items():
            vehicles.append(car(side, Role.ADVERSARY, track, xi[f"{side}_offset_m"], xi[f"{side}_speed_mps"]))
        if followed:
            behind_m = -xi["follower_gap_m"] - CAR_LENGTH_M
            vehicles.append(car("follower", Role.BACKGROUND, place.ego, behind_m, ego_speed))
        distant_m = xi["lead_gap_m"] + DISTANT_M
        vehicles.append(car("distant", Role.BACKGROUND, place.ego, distant_m, xi["lead_speed_mps"]))
        return layout_at(place, xi, car(EGO, Role.EGO, place.ego, 0.0, ego_speed), vehicles)

    return Family(
        name=name,
        summary=place.plain_summary,
        space=SceneSpace(name, _parameters(place, beside, followed=followed)),
        odd=road_odd(place, ("none",) if place.signal is None else ("fixed_time",), ("none",)),
        vehicles=("lead", *beside),
        pedestrians=(),
        layout=layout,
        mirrored=tuple(beside) == ("right",),  # most failures of the shipped family come from its left
    )


def _parameters(place: Stretch, beside: Mapping[str, Track], *, followed: bool) -> tuple[Parameter, ...]:
    limit = place.speed_limit_mps
    parameters = [
        initial_speed("ego_speed_mps", 8, limit, "initial speed of the ego"),
        Parameter("lead_gap_m", "m", 8, 50, "gap from the ego's front to the leader's rear"),
        initial_speed("lead_speed_mps", 6, limit, "initial speed of the leader"),
    ]
    for side, track in beside.items():
        low_m = -at_most(BEHIND_M, track.room_m - CAR_LENGTH_M - CLEAR_M)
        meaning = f"{side} neighbour's front relative to the ego's"
        parameters += [
            Parameter(f"{side}_offset_m", "m", low_m, AHEAD_M, meaning),
            initial_speed(f"{side}_speed_mps", 6, limit, f"initial speed of the {side} neighbour"),
        ]
    if followed:
        high_m = at_most(MOST_FOLLOWING_M, place.ego.room_m - 2 * CAR_LENGTH_M - CLEAR_M)
        meaning = "gap from the follower's front to the ego's rear"
        parameters.append(Parameter("follower_gap_m", "m", LEAST_FOLLOWING_M, high_m, meaning))
    return (*parameters, *offset_of(place.signal), friction())
