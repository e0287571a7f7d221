"""A junction: turning and crossing vehicles, background traffic, and a pedestrian where there is a crossing.

Source: RISK-SAC, Sec. IV-A.2.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from risk_sac.scenario.family import (
    Family,
    at_most,
    friction,
    initial_speed,
    offset_of,
    road_odd,
    top_speed,
    walking,
)
from risk_sac.scenario.layout import CAR_LENGTH_M, LEAD_IN_S, Layout, VehicleStart, layout_at, pedestrian, vehicle
from risk_sac.scenario.place import JunctionPlace, Leg, Track
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.world.types import Role

NEAREST_M, FARTHEST_M = 10.0, 90.0  # range of the distance of attacker and ego from the stop line
LEAST_RANGE_M = 10.0  # least range of those distances at a place
STREAM_MPS, STREAM_M = 9.0, 30.0
WIDEST_GAP_M = 40.0  # widest gap between background vehicles
LEAST_GAP_M = 10.0  # least gap from a background vehicle to others on its lane, as behind the ego in car following
WHO = {
    "ego": "the ego",
    "oncoming": "the oncoming vehicle",
    "from_left": "the vehicle from the left",
    "from_right": "the vehicle from the right",
}


def family(name: str, place: JunctionPlace) -> Family:
    """The family that this pattern is at a place."""

    def layout(xi: Mapping[str, float]) -> Layout:
        ego, *others = (_approach(leg, xi) for leg in (place.ego, *place.others))
        background = _background(place, xi, (ego, *others))
        vehicles = [each.start(Role.ADVERSARY) for each in others] + [
            each.start(Role.BACKGROUND) for each in background
        ]
        walkers = () if place.walk is None else (pedestrian(place.walk, xi),)
        return layout_at(place, xi, ego.start(Role.EGO), vehicles, walkers)

    signalised = place.signal is not None
    return Family(
        name=name,
        summary=place.plain_summary,
        space=SceneSpace(name, _parameters(place)),
        odd=road_odd(
            place,
            signals=("fixed_time",) if signalised else ("none",),
            crossings=("none",) if place.walk is None else ("signalised",) if signalised else ("zebra",),
        ),
        vehicles=tuple(leg.name for leg in place.others),
        pedestrians=() if place.walk is None else ("pedestrian",),
        layout=layout,
    )


def room_wanted_m(limit_mps: float) -> float:
    """Least room before a stop line."""
    return NEAREST_M + LEAST_RANGE_M + CAR_LENGTH_M + LEAD_IN_S * top_speed(limit_mps)


def room_of_a_stream_m() -> float:
    """Least room before the stop line of a road with background traffic."""
    return STREAM_M + 2 * WIDEST_GAP_M + CAR_LENGTH_M + LEAD_IN_S * STREAM_MPS


class _Approach(NamedTuple):
    """A vehicle on its way to the stop line."""

    name: str
    track: Track
    before_m: float  # from its front to the stop line, at the release
    speed_mps: float

    def start(self, role: Role) -> VehicleStart:
        return vehicle(self.name, role, self.track, self.before_m, self.speed_mps)

    def taken_m(self) -> tuple[float, float]:
        """Returns the range closed to background vehicles at the release.

        There they would be too close then or at the start.
        """
        least_m, gains_m = CAR_LENGTH_M + LEAST_GAP_M, LEAD_IN_S * (self.speed_mps - STREAM_MPS)
        return self.before_m - least_m + min(gains_m, 0.0), self.before_m + least_m + max(gains_m, 0.0)

    def shares_lane(self, track: Track) -> bool:
        lanes = {(piece.edge, piece.lane) for piece in track.pieces}
        return any((piece.edge, piece.lane) in lanes for piece in self.track.pieces)


def _approach(leg: Leg, xi: Mapping[str, float]) -> _Approach:
    options = len(leg.turns)
    track = leg.turns[min(int(xi.get(f"{leg.name}_turn", 0.0) * options), options - 1)]  # equal parts of [0, 1]
    return _Approach(leg.name, track, xi[f"{leg.name}_distance_m"], xi[f"{leg.name}_speed_mps"])


def _background(place: JunctionPlace, xi: Mapping[str, float], others: Sequence[_Approach]) -> list[_Approach]:
    """Two vehicles a stream.

    One that would be too close to another on its lane starts behind that, or is left out where the road is too short.
    """
    background: list[_Approach] = []
    for stream in place.streams:
        track = stream.track
        for i in (0, 1):
            before_m = STREAM_M + (i + 1) * xi["background_gap_m"]
            taken = [each.taken_m() for each in (*others, *background) if each.shares_lane(track)]
            while crowded := [last_m for first_m, last_m in taken if first_m < before_m < last_m]:
                before_m = max(crowded)
            if before_m + CAR_LENGTH_M + LEAD_IN_S * STREAM_MPS <= track.room_m:
                background.append(_Approach(f"{stream.name}_{i}", track, before_m, STREAM_MPS))
    return background


def _parameters(place: JunctionPlace) -> tuple[Parameter, ...]:
    parameters = [parameter for leg in (place.ego, *place.others) for parameter in _leg_parameters(leg)]
    if place.walk is not None:
        parameters += walking("pedestrian across the near crossing's axis")
    if place.streams:
        meaning = "spacing of the background vehicles"
        parameters.append(Parameter("background_gap_m", "m", 15, WIDEST_GAP_M, meaning))
    return (*parameters, *offset_of(place.signal), friction())


def _leg_parameters(leg: Leg) -> list[Parameter]:
    who, options = WHO.get(leg.name, leg.name.replace("_", " ")), len(leg.turns)
    parameters = []
    if options == 3:
        meaning = f"{who} turns left below 1/3, right above 2/3, else goes straight"
        parameters.append(Parameter(f"{leg.name}_turn", "1", 0, 1, meaning))
    elif options > 1:
        parameters.append(
            Parameter(f"{leg.name}_turn", "1", 0, 1, f"which of {options} ways {who} goes, from the left")
        )
    room_m = min(track.room_m for track in leg.turns)
    high_m = at_most(FARTHEST_M, room_m - CAR_LENGTH_M - LEAD_IN_S * top_speed(leg.speed_limit_mps))
    return [
        *parameters,
        Parameter(f"{leg.name}_distance_m", "m", NEAREST_M, high_m, f"{who}'s front to its stop line"),
        initial_speed(f"{leg.name}_speed_mps", 5, leg.speed_limit_mps, f"initial speed of {who}"),
    ]
