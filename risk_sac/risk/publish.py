"""From a frame to the published signals."""

import numpy as np
from numpy.typing import NDArray

from risk_sac.geometry import RelativeView
from risk_sac.jit import compiled
from risk_sac.risk.rss import LATERAL_CAP_M, LONGITUDINAL_CAP_M
from risk_sac.risk.ttc import TTC_CAP_S
from risk_sac.types import Bools, Floats, Frame, Kind, Signal

GAP_CAP_M = 50.0
CROSSED_ON_RED_M = -1.0
PEDESTRIAN = int(Kind.PEDESTRIAN)  # compiled code knows no enums of int8


@compiled
def in_charge(view: RelativeView) -> Bools:
    """The actors the ego answers for, `n`: ahead of it or alongside.

    Choice: whoever comes from behind must keep the distance (RSS, rule 1), so TTC and RSS do not count
    them; otherwise tailgating the ego would look like a risk the ego takes.
    """
    return view.x > -view.ego_half_length


@compiled
def worst_rss_margin(view: RelativeView, rss_longitudinal_m: Floats, rss_lateral_m: Floats) -> float:
    """Smallest RSS margin: of each actor the ego answers for, the larger of the two, since it takes both, m."""
    worst = LONGITUDINAL_CAP_M
    charge = in_charge(view)
    for i in range(len(charge)):
        if charge[i]:
            worst = min(worst, max(rss_longitudinal_m[i], rss_lateral_m[i]))
    return worst


def publish(
    frame: Frame,
    before: Frame | None,
    view: RelativeView,
    ttc_s: Floats,
    rss_longitudinal_m: Floats,
    rss_lateral_m: Floats,
) -> dict[str, float]:
    """The value of every signal in `risk_sac.risk.signals.SIGNALS`.

    Args:
      frame: all actors now; index 0 is the ego.
      before: the previous frame, None at the start.
      view: the `n` others in the ego's frame.
      ttc_s: `n`.
      rss_longitudinal_m: `n`.
      rss_lateral_m: `n`.
    """
    ttc, longitudinal, lateral, pedestrian, vehicle = _least(view, ttc_s, rss_longitudinal_m, rss_lateral_m, frame.kind)
    return {
        "ttc_s": ttc,
        "rss_longitudinal_m": longitudinal,
        "rss_lateral_m": lateral,
        "pedestrian_gap_m": pedestrian,
        "vehicle_gap_m": vehicle,
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


@compiled
def _least(
    view: RelativeView, ttc_s: Floats, rss_longitudinal_m: Floats, rss_lateral_m: Floats, kind: NDArray[np.int8]
) -> tuple[float, float, float, float, float]:
    ttc, longitudinal, lateral = TTC_CAP_S, LONGITUDINAL_CAP_M, LATERAL_CAP_M
    pedestrian = vehicle = GAP_CAP_M
    charge = in_charge(view)
    for i in range(len(charge)):
        if charge[i]:
            ttc = min(ttc, ttc_s[i])
            if rss_lateral_m[i] < 0.0:
                longitudinal = min(longitudinal, rss_longitudinal_m[i])
            if rss_longitudinal_m[i] < 0.0:
                lateral = min(lateral, rss_lateral_m[i])
        if kind[i + 1] == PEDESTRIAN:
            pedestrian = min(pedestrian, view.gap[i])
        else:
            vehicle = min(vehicle, view.gap[i])
    return ttc, longitudinal, lateral, pedestrian, vehicle
