"""Computes the published signals of a frame."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.geometry import RelativeView, frame_view, time_to_contact
from risk_sac.jit import compiled
from risk_sac.risk.own_motion import OwnMotion
from risk_sac.risk.rss import LONGITUDINAL_CAP_M, SCALED_HIGH, margins
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.risk.ttc import ENCOUNTER_CAP_S, TTC_CAP_S, time_to_encounter
from risk_sac.types import Bools, Floats, Frame, Kind, Signal

GAP_CAP_M = 50.0
PEDESTRIAN_GAP_CAP_M = 30.0
RED_LIGHT_BRAKING_CAP_MPS2 = 12.0
STOP_TOLERANCE_M = 0.5  # past the line: creeping up to it needs no braking
CROSSED_ON_RED_M = -1.0
PEDESTRIAN = int(Kind.PEDESTRIAN)  # compiled code knows no enums of int8


# Rows of an assessment, one column for each of the `n` actors other than the ego, in its frame as in `RelativeView`.
AHEAD, ASIDE, CLOSING_X, CLOSING_Y, COS, SIN, GAP, SEEN = range(8)
TTC, ENCOUNTER, RSS_LONGITUDINAL, RSS_LATERAL, RSS_SCALED, CHARGED = range(8, 14)


class LeastMargins(NamedTuple):
    """The smallest of each measure over the actors it concerns; its cap where there is none."""

    ttc_s: float
    encounter_s: float
    rss_margin: float
    pedestrian_gap_m: float
    vehicle_gap_m: float


class Assessment(NamedTuple):
    """Risk measures of one frame, for each of the `n` actors other than the ego."""

    others: Floats  # the rows above x n
    least: LeastMargins
    touched: bool  # whether the ego touches another actor

    @property
    def gap_m(self) -> Floats:
        """Distance between the bodies."""
        gap: Floats = self.others[GAP]
        return gap

    @property
    def seen(self) -> Bools:
        """Whether each of the others is in the ego's sight."""
        seen: Bools = self.others[SEEN] != 0.0
        return seen


def assess(frame: Frame, rss: RssParameters, seen: Bools, struck: int = 0) -> Assessment:
    """Computes all measures of a frame in one compiled call.

    `struck` is the column of an actor that the ego touched in the step: the two touch even if they have parted since.
    """
    others, least, touched = _assess(frame.state, frame.kind, tuple(rss), seen, struck)
    return Assessment(others, LeastMargins(*least), touched)


@compiled
def _assess(
    state: Floats, kind: NDArray[np.int8], rss: tuple[float, ...], seen: Bools, struck: int
) -> tuple[Floats, tuple[float, float, float, float, float], bool]:
    view = frame_view(state)
    ttc_s = np.minimum(time_to_contact(view), TTC_CAP_S)
    walks = kind[1:] == PEDESTRIAN
    rss_margins = margins(view, walks, RssParameters(*rss))  # to pass a named tuple costs as much as the margins
    encounter_s = time_to_encounter(view, walks)
    charged = in_charge(view)
    n = len(charged)
    others = np.empty((CHARGED + 1, n))
    touched = False
    for i in range(n):
        touched |= view.overlap[i]
        others[AHEAD, i], others[ASIDE, i] = view.x[i], view.y[i]
        others[CLOSING_X, i], others[CLOSING_Y, i] = view.vx[i], view.vy[i]
        others[COS, i], others[SIN, i], others[GAP, i] = view.cos[i], view.sin[i], view.gap[i]
        others[SEEN, i], others[TTC, i], others[ENCOUNTER, i] = seen[i], ttc_s[i], encounter_s[i]
        others[RSS_LONGITUDINAL, i] = rss_margins.longitudinal_m[i]
        others[RSS_LATERAL, i] = rss_margins.lateral_m[i]
        others[RSS_SCALED, i], others[CHARGED, i] = rss_margins.scaled[i], charged[i]
    if struck > 0:
        for row in (GAP, TTC, ENCOUNTER):
            others[row, struck - 1] = 0.0
    return others, least_margins(others, kind), touched


@compiled
def in_charge(view: RelativeView) -> Bools:
    """Whether the ego answers for each of `n` actors: for those ahead or alongside.

    Choice: an actor from behind must keep the distance (RSS, rule 1), so TTC and RSS do not count it.
    """
    return view.x > -view.ego_half_length


@compiled
def least_margins(others: Floats, kind: NDArray[np.int8]) -> tuple[float, float, float, float, float]:
    """Computes `LeastMargins`.

    TTC and RSS are over the actors that the ego answers for, gaps and encounters over all.
    """
    ttc, encounter, rss = TTC_CAP_S, ENCOUNTER_CAP_S, SCALED_HIGH
    pedestrian, vehicle = PEDESTRIAN_GAP_CAP_M, GAP_CAP_M
    for i in range(others.shape[1]):
        if others[CHARGED, i] != 0.0:
            ttc = min(ttc, others[TTC, i])
            rss = min(rss, others[RSS_SCALED, i])
        encounter = min(encounter, others[ENCOUNTER, i])
        if kind[i + 1] == PEDESTRIAN:
            pedestrian = min(pedestrian, others[GAP, i])
        else:
            vehicle = min(vehicle, others[GAP, i])
    return ttc, encounter, rss, pedestrian, vehicle


def worst_rss_margin(assessment: Assessment) -> float:
    """Finds the smallest RSS margin of the actors that the ego answers for, m.

    An actor's margin is the larger of its longitudinal and its lateral one.
    """
    margin = np.maximum(assessment.others[RSS_LONGITUDINAL], assessment.others[RSS_LATERAL])
    return float(margin.min(where=assessment.others[CHARGED] != 0.0, initial=LONGITUDINAL_CAP_M))


def publish(frame: Frame, before: Frame | None, least: LeastMargins, own: OwnMotion) -> dict[str, float]:
    """Returns the value of every signal in `SIGNALS`.

    `before` is the previous frame; `least` and `own` are of `frame`.
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
        "ego_jerk_mps3": own.ego_jerk_mps3,
        "ego_lateral_accel_mps2": own.ego_lateral_accel_mps2,
        "lane_offset_m": own.lane_offset_m,
        "over_limit_mps": own.over_limit_mps,
        "edge_m": own.edge_m,
        "carriageway_m": own.carriageway_m,
        "headway_s": own.headway_s,
    }


def red_light_margin(frame: Frame, before: Frame | None) -> float:
    """Computes the distance to the stop line while the signal is red, m.

    It is `CROSSED_ON_RED_M` in the step that crosses the line.
    """
    if _crossed_on_red(frame, before):
        return CROSSED_ON_RED_M
    if frame.signal is Signal.RED:
        return min(frame.stop_line_m, GAP_CAP_M)
    return GAP_CAP_M


def red_light_braking(frame: Frame, before: Frame | None) -> float:
    """Computes the braking that stops the ego at a red signal's line, m/s².

    It is v² / (2 d), and its cap in the step that crosses the line.
    """
    if _crossed_on_red(frame, before):
        return RED_LIGHT_BRAKING_CAP_MPS2
    if frame.signal is not Signal.RED:
        return 0.0
    room_m = max(frame.stop_line_m, 0.0) + STOP_TOLERANCE_M
    return min(frame.ego_speed_mps**2 / (2 * room_m), RED_LIGHT_BRAKING_CAP_MPS2)


def _crossed_on_red(frame: Frame, before: Frame | None) -> bool:
    """Whether the ego has just passed a red signal: the next one is suddenly farther, or there is none."""
    return before is not None and before.signal is Signal.RED and before.stop_line_m < frame.stop_line_m - 1.0
