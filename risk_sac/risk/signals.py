"""The signals that requirements may speak about, published once per frame.

All are finite: a quantity with nothing to measure takes its cap.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SignalInfo:
    """Unit, range and meaning of one published signal."""

    unit: str
    low: float
    high: float
    meaning: str


SIGNALS: dict[str, SignalInfo] = {
    "ttc_s": SignalInfo("s", 0.0, 10.0, "smallest time to collision of the ego with any actor"),
    "encounter_s": SignalInfo(
        "s",
        0.0,
        8.0,
        "smallest time to encounter of the ego with any actor: a time to collision in which a near miss counts as the "
        "time that unforeseen motion takes to close the gap; it falls steadily before a contact",
    ),
    "rss_margin": SignalInfo(
        "1",
        -3.0,
        2.0,
        "smallest RSS margin to any actor, about 1 in undisturbed traffic: of the longitudinal and the lateral margin, "
        "each in its scale, the larger; negative where the situation is dangerous",
    ),
    "pedestrian_gap_m": SignalInfo("m", 0.0, 30.0, "distance from the ego's body to the nearest pedestrian"),
    "vehicle_gap_m": SignalInfo("m", 0.0, 50.0, "distance from the ego's body to the nearest vehicle"),
    "red_light_m": SignalInfo(
        "m", -5.0, 50.0, "distance to the stop line while its signal is red; negative once it was crossed on red"
    ),
    "red_light_braking_mps2": SignalInfo(
        "m/s²",
        0.0,
        12.0,
        "braking that stops the ego at a red signal's line; 12 once it was crossed on red, 0 without one",
    ),
    "ego_speed_mps": SignalInfo("m/s", 0.0, 60.0, "speed of the ego"),
    "ego_braking_mps2": SignalInfo("m/s²", 0.0, 12.0, "deceleration of the ego; 0 while it accelerates"),
    "ego_jerk_mps3": SignalInfo("m/s³", 0.0, 60.0, "size of the ego's jerk: its change of acceleration over 0.3 s"),
    "ego_lateral_accel_mps2": SignalInfo(
        "m/s²", 0.0, 20.0, "size of the ego's lateral acceleration: its speed times its change of heading over 0.3 s"
    ),
    "lane_offset_m": SignalInfo(
        "m", 0.0, 10.0, "distance of the ego's centre from the middle of the nearest lane of its direction"
    ),
    "over_limit_mps": SignalInfo(
        "m/s", -60.0, 60.0, "speed of the ego above the limit of the lane where it is; negative below the limit"
    ),
    "edge_m": SignalInfo(
        "m",
        -10.0,
        5.0,
        "smallest distance from the ego's body to the edge of the carriageway of its direction; negative by how far a "
        "part of its body is beyond. Oncoming lanes count only while it overtakes",
    ),
    "carriageway_m": SignalInfo(
        "m",
        -10.0,
        3.0,
        "how deep the ego's body reaches into the carriageway of its direction: positive while a part of it is on it, "
        "else the gap to it, negative. Oncoming lanes count only while it overtakes",
    ),
    "headway_s": SignalInfo(
        "s", 0.0, 10.0, "time gap from the ego's front to the vehicle that it follows, along the arc that it drives"
    ),
}
