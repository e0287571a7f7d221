"""A pedestrian at a crossing, hidden from the ego by a standing vehicle.

The vehicle waits before the crossing on a lane to the ego's right, and the pedestrian comes from there. Where the ego's
road has no such lane, the pedestrian comes from the left. The vehicle then came the other way and stands just beyond
the crossing, like the end of a queue.

Source: RISK-SAC, Sec. IV-A.2.
"""

from collections.abc import Mapping

from risk_sac.config import CrossingType, SignalType
from risk_sac.scenario.family import (
    EGO,
    Family,
    at_most,
    friction,
    initial_speed,
    offset_of,
    road_odd,
    top_speed,
    walking,
)
from risk_sac.scenario.layout import LEAD_IN_S, TRUCK_LENGTH_M, Layout, VehicleStart, layout_at, pedestrian, vehicle
from risk_sac.scenario.place import CrossingPlace, Site
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.world.types import Role

NEAREST_M, FARTHEST_M = 25.0, 90.0  # range of the ego's distance from the crossing
FOLLOWING_M = 25.0  # distance from the ego's front to its follower's
OCCLUDER_MPS = 12.0
OCCLUDER_M = 25  # greatest distance of the occluder from the crossing
ONCOMING, ONCOMING_MPS = 4, 10.0
ONCOMING_M, SPACING_M = 60.0, 30.0  # distance of the first oncoming vehicle from the crossing, and between them


def family(name: str, place: CrossingPlace) -> Family:
    """The family that this pattern is at a place."""

    def layout(xi: Mapping[str, float]) -> Layout:
        site = place.sites[-1] if xi.get("crossing", 1.0) >= 0.5 else place.sites[0]
        ego_m, ego_mps = xi["ego_distance_m"], xi["ego_speed_mps"]
        occluder_m, occluder_mps = xi["occluder_distance_m"], xi["occluder_speed_mps"]
        before_m = -occluder_m - TRUCK_LENGTH_M if site.beyond else occluder_m
        ego = vehicle(EGO, Role.EGO, site.ego, ego_m, ego_mps)
        occluder = vehicle("occluder", Role.ADVERSARY, site.occluder, before_m, occluder_mps, body="truck")
        follower = vehicle("follower", Role.BACKGROUND, site.ego, ego_m + FOLLOWING_M, ego_mps)
        return layout_at(place, xi, ego, (occluder, follower, *_oncoming(site)), (pedestrian(site.walk, xi),))

    return Family(
        name=name,
        summary=place.plain_summary,
        space=SceneSpace(name, _parameters(place)),
        odd=road_odd(
            place,
            signals=tuple(sorted({_SIGNALS[site.signalised] for site in place.sites})),
            crossings=tuple(sorted({_CROSSINGS[site.signalised] for site in place.sites})),
        ),
        vehicles=("occluder",),
        pedestrians=("pedestrian",),
        layout=layout,
        mirrored=any(site.beyond for site in place.sites),  # its pedestrian comes from the left
    )


_SIGNALS: dict[bool, SignalType] = {False: "none", True: "fixed_time"}
_CROSSINGS: dict[bool, CrossingType] = {False: "zebra", True: "signalised"}


def room_wanted_m(limit_mps: float) -> float:
    """Least room before a crossing on the ego's track."""
    return NEAREST_M + FOLLOWING_M + TRUCK_LENGTH_M + LEAD_IN_S * top_speed(limit_mps)


def room_beyond_m() -> float:
    """Least room before a crossing on an oncoming occluder's track."""
    return LEAD_IN_S * OCCLUDER_MPS + TRUCK_LENGTH_M


def _farthest_m(site: Site, lead_m: float) -> float:
    if site.beyond:
        last = site.occluder.pieces[-1]
        return at_most(OCCLUDER_M, last.length_m - last.reach_m - TRUCK_LENGTH_M)
    return at_most(OCCLUDER_M, site.occluder.room_m - TRUCK_LENGTH_M - lead_m)


def _oncoming(site: Site) -> list[VehicleStart]:
    starts = []
    for i in range(ONCOMING if site.oncoming else 0):
        track = site.oncoming[i % len(site.oncoming)]
        if track.room_m >= ONCOMING_M + SPACING_M * i + TRUCK_LENGTH_M:
            id_, lead_m = f"oncoming_{i}", SPACING_M * i
            starts.append(vehicle(id_, Role.BACKGROUND, track, ONCOMING_M, ONCOMING_MPS, lead_m))
    return starts


def _parameters(place: CrossingPlace) -> tuple[Parameter, ...]:
    limit = place.speed_limit_mps
    kinds = []
    if len(place.sites) > 1:
        odd, kinds_of = "scenery.crossing_types", ("zebra", "signalised")
        kinds.append(Parameter("crossing", "1", 0, 1, "zebra below 0.5, signalised from 0.5", odd, kinds_of))
    lead_m = LEAD_IN_S * top_speed(limit)
    ego_m = at_most(FARTHEST_M, min(site.ego.room_m for site in place.sites) - FOLLOWING_M - TRUCK_LENGTH_M - lead_m)
    occluder_m = min(_farthest_m(site, lead_m) for site in place.sites)
    beyond = any(site.beyond for site in place.sites)
    whence = "crossing's far edge to the occluder's rear" if beyond else "occluder's front to the crossing's near edge"
    return (
        *kinds,
        initial_speed("ego_speed_mps", 6, limit, "initial speed of the ego"),
        Parameter("ego_distance_m", "m", NEAREST_M, ego_m, "ego's front to the crossing's near edge"),
        Parameter("occluder_distance_m", "m", 0.5, occluder_m, whence),
        initial_speed("occluder_speed_mps", 0, min(OCCLUDER_MPS, limit), "initial speed of the occluder"),
        *walking("pedestrian along the road from the crossing's axis"),
        *offset_of(place.signal),
        friction(),
    )
