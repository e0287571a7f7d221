"""From a frame to the published signals."""

import math

import numpy as np

from risk_sac.geometry import RelativeView
from risk_sac.risk.rss import LATERAL_CAP_M, LONGITUDINAL_CAP_M
from risk_sac.risk.ttc import TTC_CAP_S
from risk_sac.types import Bools, Floats, Frame, Kind, Signal

GAP_CAP_M = 50.0
CROSSED_ON_RED_M = -1.0


def in_charge(view: RelativeView) -> Bools:
    """The actors the ego answers for, `n`: ahead of it or alongside.

    Choice: whoever comes from behind must keep the distance (RSS, rule 1), so TTC and RSS do not count
    them; otherwise tailgating the ego would look like a risk the ego takes.
    """
    ahead: Bools = view.x > -view.ego_half_length
    return ahead


def publish(
    frame: Frame,
    before: Frame | None,
    view: RelativeView,
    ttc_s: Floats,
    rss_longitudinal_m: Floats,
    rss_lateral_m: Floats,
    gap_m: Floats,
) -> dict[str, float]:
    """The value of every signal in `risk_sac.risk.signals.SIGNALS`.

    Args:
      frame: all actors now; index 0 is the ego.
      before: the previous frame, None at the start.
      view: the `n` others in the ego's frame.
      ttc_s: `n`.
      rss_longitudinal_m: `n`.
      rss_lateral_m: `n`.
      gap_m: `n`, distance between the bodies.
    """
    charge = in_charge(view)
    walking = frame.kind[1:] == Kind.PEDESTRIAN
    return {
        "ttc_s": _least(ttc_s, charge, TTC_CAP_S),
        "rss_longitudinal_m": _least(rss_longitudinal_m, charge & (rss_lateral_m < 0), LONGITUDINAL_CAP_M),
        "rss_lateral_m": _least(rss_lateral_m, charge & (rss_longitudinal_m < 0), LATERAL_CAP_M),
        "pedestrian_gap_m": _least(gap_m, walking, GAP_CAP_M),
        "vehicle_gap_m": _least(gap_m, ~walking, GAP_CAP_M),
        "red_light_m": red_light_margin(frame, before),
        "ego_speed_mps": frame.ego_speed_mps,
        "ego_braking_mps2": max(0.0, -float(frame.accel_mps2[0])),
    }


def red_light_margin(frame: Frame, before: Frame | None) -> float:
    """Distance to the stop line while the signal is red, m; `CROSSED_ON_RED_M` in the step that crosses it."""
    if before is not None and before.signal is Signal.RED and before.stop_line_m < frame.stop_line_m - 1.0:
        return CROSSED_ON_RED_M  # the signal ahead is suddenly a farther one, or none: the ego has passed it
    if frame.signal is Signal.RED:
        return min(frame.stop_line_m, GAP_CAP_M)
    return GAP_CAP_M


def _least(values: Floats, among: Bools, cap: float) -> float:
    least = float(np.min(values, where=among, initial=math.inf))
    return min(least, cap)
