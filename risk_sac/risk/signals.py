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
    "rss_longitudinal_m": SignalInfo(
        "m", -50.0, 50.0, "smallest longitudinal RSS margin to an actor inside the lateral RSS distance"
    ),
    "rss_lateral_m": SignalInfo(
        "m", -5.0, 5.0, "smallest lateral RSS margin to an actor inside the longitudinal RSS distance"
    ),
    "pedestrian_gap_m": SignalInfo("m", 0.0, 50.0, "distance from the ego's body to the nearest pedestrian"),
    "vehicle_gap_m": SignalInfo("m", 0.0, 50.0, "distance from the ego's body to the nearest vehicle"),
    "red_light_m": SignalInfo(
        "m", -5.0, 50.0, "distance to the stop line while its signal is red; negative once it was crossed on red"
    ),
    "ego_speed_mps": SignalInfo("m/s", 0.0, 60.0, "speed of the ego"),
    "ego_braking_mps2": SignalInfo("m/s²", 0.0, 12.0, "deceleration of the ego; 0 while it accelerates"),
}
