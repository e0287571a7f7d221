"""From a frame to the published signals."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.geometry import RelativeView, Sight, frame_view, in_sight
from risk_sac.jit import compiled
from risk_sac.risk.encounter import ENCOUNTER_CAP_S, time_to_encounter
from risk_sac.risk.rss import LONGITUDINAL_CAP_M, SCALED_HIGH, RssParameters, margins
from risk_sac.risk.ttc import TTC_CAP_S, time_to_collision
from risk_sac.types import Bools, Floats, Frame, Kind, Signal

GAP_CAP_M = 50.0
PEDESTRIAN_GAP_CAP_M = 30.0
RED_LIGHT_BRAKING_CAP_MPS2 = 12.0
STOP_TOLERANCE_M = 0.5  # past the line: creeping up to it is no braking
CROSSED_ON_RED_M = -1.0
VEHICLE, PEDESTRIAN = int(Kind.VEHICLE), int(Kind.PEDESTRIAN)  # compiled code knows no enums of int8


@compiled
def in_charge(view: RelativeView) -> Bools:
    """The actors the ego answers for, `n`: ahead of it or alongside.

    Choice: whoever comes from behind must keep the distance (RSS, rule 1), so TTC and RSS do not count
    them; otherwise tailgating the ego would look like a risk the ego takes.
    """
    return view.x > -view.ego_half_length


class LeastMargins(NamedTuple):
    """The smallest of each measure over the actors it concerns; its cap where there is none."""

    ttc_s: float
    encounter_s: float
    rss_margin: float
    pedestrian_gap_m: float
    vehicle_gap_m: float


class Assessment(NamedTuple):
    """What one frame says about risk; arrays hold the `n` actors other than the ego."""

    view: RelativeView
    seen: Bools  # in the ego's sight
    ttc_s: Floats
    rss_longitudinal_m: Floats
    rss_lateral_m: Floats
    rss_margin: Floats  # scaled
    least: LeastMargins


def assess(frame: Frame, rss: RssParameters, sight: Sight) -> Assessment:
    """All measures of a frame, in one compiled call."""
    return _assess(
        frame.x_m,
        frame.y_m,
        frame.heading_rad,
        frame.vx_mps,
        frame.vy_mps,
        frame.length_m,
        frame.width_m,
        frame.kind,
        rss,
        sight,
    )


@compiled
def _assess(
    x: Floats,
    y: Floats,
    heading: Floats,
    vx: Floats,
    vy: Floats,
    length: Floats,
    width: Floats,
    kind: NDArray[np.int8],
    rss: RssParameters,
    sight: Sight,
) -> Assessment:
    view = frame_view(x, y, heading, vx, vy, length, width)
    ttc_s = time_to_collision(view)
    walks = kind[1:] == PEDESTRIAN
    rss_margins = margins(view, walks, rss)
    return Assessment(
        view,
        in_sight(view, kind[1:] == VEHICLE, sight),
        ttc_s,
        rss_margins.longitudinal_m,
        rss_margins.lateral_m,
        rss_margins.scaled,
        least_margins(view, kind, ttc_s, time_to_encounter(view, walks), rss_margins.scaled),
    )


@compiled
def least_margins(
    view: RelativeView, kind: NDArray[np.int8], ttc_s: Floats, encounter_s: Floats, rss_margin: Floats
) -> LeastMargins:
    """See `LeastMargins`; TTC and RSS over those the ego answers for, gaps and encounters over all."""
    ttc, encounter, rss = TTC_CAP_S, ENCOUNTER_CAP_S, SCALED_HIGH
    pedestrian, vehicle = PEDESTRIAN_GAP_CAP_M, GAP_CAP_M
    charge = in_charge(view)
    for i in range(len(charge)):
        if charge[i]:
            ttc = min(ttc, ttc_s[i])
            rss = min(rss, rss_margin[i])
        encounter = min(encounter, encounter_s[i])
        if kind[i + 1] == PEDESTRIAN:
            pedestrian = min(pedestrian, view.gap[i])
        else:
            vehicle = min(vehicle, view.gap[i])
    return LeastMargins(ttc, encounter, rss, pedestrian, vehicle)


def worst_rss_margin(assessment: Assessment) -> float:
    """Smallest RSS margin: of each actor the ego answers for, the larger of the two, since it takes both, m."""
    margin = np.maximum(assessment.rss_longitudinal_m, assessment.rss_lateral_m)
    return float(margin.min(where=in_charge(assessment.view), initial=LONGITUDINAL_CAP_M))


def publish(frame: Frame, before: Frame | None, least: LeastMargins) -> dict[str, float]:
    """The value of every signal in `risk_sac.risk.signals.SIGNALS`.

    Args:
      frame: all actors now; index 0 is the ego.
      before: the previous frame, None at the start.
      least: of `frame`.
    """
    return {
        "ttc_s": least.ttc_s,
        "encounter_s": least.encounter_s,
        "rss_margin": least.rss_margin,
        "pedestrian_gap_m": least.pedestrian_gap_m,
        "vehicle_gap_m": least.vehicle_gap_m,
        "red_light_m": red_light_margin(frame, before),
        "red_light_braking_mps2": red_light_braking(frame, before),
        "ego_speed_mps": frame.ego_speed_mps,
        "ego_braking_mps2": max(0.0, -float(frame.accel_mps2[0])),
    }


def red_light_margin(frame: Frame, before: Frame | None) -> float:
    """Distance to the stop line while the signal is red, m; `CROSSED_ON_RED_M` in the step that crosses it."""
    if _crossed_on_red(frame, before):
        return CROSSED_ON_RED_M
    if frame.signal is Signal.RED:
        return min(frame.stop_line_m, GAP_CAP_M)
    return GAP_CAP_M


def red_light_braking(frame: Frame, before: Frame | None) -> float:
    """Braking that stops the ego at a red signal's line, v² / (2 d), m/s²; its cap in the step that crosses it."""
    if _crossed_on_red(frame, before):
        return RED_LIGHT_BRAKING_CAP_MPS2
    if frame.signal is not Signal.RED:
        return 0.0
    room_m = max(frame.stop_line_m, 0.0) + STOP_TOLERANCE_M
    return min(frame.ego_speed_mps**2 / (2 * room_m), RED_LIGHT_BRAKING_CAP_MPS2)


def _crossed_on_red(frame: Frame, before: Frame | None) -> bool:
    """Whether the signal ahead is suddenly a farther one, or none: the ego has passed it."""
    return before is not None and before.signal is Signal.RED and before.stop_line_m < frame.stop_line_m - 1.0
