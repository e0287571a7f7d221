"""Measures the ego and its actors, and publishes the signals of requirements."""

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.maps.carriageway import ANY_WAY, Carriageway, sector_of
from risk_sac.risk.rss import ENCOUNTER_CAP_S, LONGITUDINAL_CAP_M, SCALED_HIGH, TTC_CAP_S, margins, time_to_encounter
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.world.geometry import RelativeView, frame_view, time_to_contact
from risk_sac.world.jit import compiled
from risk_sac.world.types import ACCEL, HEADING, LENGTH, SPEED, STEP_S, WIDTH, Bools, Floats, Frame, Kind, Signal, X, Y

WINDOW_S = 0.3  # over which changes of acceleration and heading are taken: SUMO's drivers correct in every step
JERK_CAP_MPS3 = 60.0
LATERAL_ACCEL_CAP_MPS2 = 20.0
LANE_OFFSET_CAP_M = 10.0
OVER_LIMIT_CAP_MPS = 60.0
BEYOND_CAP_M = -10.0  # the carriageway is not searched farther away
EDGE_CAP_M = 5.0
CARRIAGEWAY_CAP_M = 3.0
HEADWAY_CAP_S = 10.0

SAME_WAY_COS = 0.5  # lanes at more than 60° are not of the ego's direction
STANDING_MPS = 0.5
PASSING_M, PASSED_M = 30.0, 10.0  # before the ego's centre and behind its rear: an ego beside such an actor overtakes
LEAST_SPEED_MPS = 1.0  # a slower ego has no curvature
MOST_CURVATURE = 0.2  # 1/m; no car turns more sharply
VEHICLE = int(Kind.VEHICLE)  # compiled code knows no enums of int8


class OwnMotion(NamedTuple):
    """Values of the ego's motion signals in one frame."""

    ego_jerk_mps3: float
    ego_lateral_accel_mps2: float
    lane_offset_m: float
    over_limit_mps: float
    edge_m: float
    carriageway_m: float
    headway_s: float


class OwnMotionGauge:
    """Measures the ego's motion frame by frame.

    Attributes:
      carriageway: of the net.
    """

    def __init__(self) -> None:
        self.reset(Carriageway())

    def reset(self, carriageway: Carriageway) -> None:
        """Begins an episode on a net."""
        self.carriageway = carriageway
        self._past = deque[tuple[float, float, float]](maxlen=round(WINDOW_S / STEP_S) + 1)

    def remember(self, frame: Frame) -> None:
        """Stores the next frame without measuring it."""
        self._past.append((frame.time_s, frame.state.item(HEADING, 0), frame.state.item(ACCEL, 0)))

    def measure(self, frame: Frame) -> OwnMotion:
        """Measures the next frame."""
        state = frame.state
        x_m, y_m, heading_rad = state.item(X, 0), state.item(Y, 0), state.item(HEADING, 0)
        self.remember(frame)
        around = self.carriageway.around(x_m, y_m, sector_of(heading_rad))
        measured, overtakes = _measured(state, frame.kind, self._past[0], frame.time_s, *around)
        if overtakes:
            around = self.carriageway.around(x_m, y_m, ANY_WAY)
            measured, _ = _measured(state, frame.kind, self._past[0], frame.time_s, *around)
        return OwnMotion(*measured)


@compiled
def _measured(
    state: Floats, kind: NDArray[np.int8], past: tuple[float, float, float], now_s: float, edges: Floats, lanes: Floats
) -> tuple[tuple[float, float, float, float, float, float, float], bool]:
    """Returns `OwnMotion`'s fields, and whether the ego overtakes beyond its direction's edge."""
    past_s, past_heading, past_accel = past
    speed, span_s = state[SPEED, 0], now_s - past_s
    jerk, yaw_rate = 0.0, 0.0
    if span_s > WINDOW_S - STEP_S / 2:  # else the episode has just begun, and how it began is no motion
        turn = state[HEADING, 0] - past_heading
        yaw_rate = math.atan2(math.sin(turn), math.cos(turn)) / span_s
        jerk = min(abs(state[ACCEL, 0] - past_accel) / span_s, JERK_CAP_MPS3)
    offset, limit, _ = nearest_lane(lanes, state[X, 0], state[Y, 0], state[HEADING, 0])
    edge, carriageway = depths(edges, state)
    curvature = 0.0 if speed < LEAST_SPEED_MPS else min(max(yaw_rate / speed, -MOST_CURVATURE), MOST_CURVATURE)
    measured = (
        jerk,
        min(speed * abs(yaw_rate), LATERAL_ACCEL_CAP_MPS2),
        min(offset, LANE_OFFSET_CAP_M),
        max(speed - limit, -OVER_LIMIT_CAP_MPS),
        edge,
        carriageway,
        headway(state, kind, curvature),
    )
    return measured, edge < 0.0 and overtakes(edges, state)


@compiled
def nearest_lane(lanes: Floats, x: float, y: float, heading: float) -> tuple[float, float, float]:
    """Finds the nearest lane of a heading's direction: distance, limit and width.

    The distance is to the lane's middle, inf without one; limit and width are then those of the nearest lane of any
    direction, inf without one.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    least2, least2_any, own, other = math.inf, math.inf, -1, -1
    for i in range(len(lanes)):
        dx, dy = x - lanes[i, 0], y - lanes[i, 1]
        along = min(max(dx * lanes[i, 2] + dy * lanes[i, 3], 0.0), lanes[i, 4])
        dx, dy = dx - along * lanes[i, 2], dy - along * lanes[i, 3]
        distance2 = dx * dx + dy * dy
        if distance2 < least2_any:
            least2_any, other = distance2, i
        if distance2 < least2 and cos * lanes[i, 2] + sin * lanes[i, 3] > SAME_WAY_COS:
            least2, own = distance2, i
    nearest = own if own >= 0 else other
    if nearest < 0:
        return math.inf, math.inf, math.inf
    return math.sqrt(least2), lanes[nearest, 5], lanes[nearest, 6]


@compiled
def depths(edges: Floats, state: Floats) -> tuple[float, float]:
    """Least and largest carriageway depth over 15 points of the ego's body."""
    cos, sin = math.cos(state[HEADING, 0]), math.sin(state[HEADING, 0])
    least, largest = EDGE_CAP_M, BEYOND_CAP_M
    for i in range(-2, 3):
        for j in range(-1, 2):
            along, across = i * state[LENGTH, 0] / 4, j * state[WIDTH, 0] / 2
            here = depth(edges, state[X, 0] + along * cos - across * sin, state[Y, 0] + along * sin + across * cos)
            least, largest = min(least, here), max(largest, here)
    return max(least, BEYOND_CAP_M), min(largest, CARRIAGEWAY_CAP_M)


@compiled
def depth(edges: Floats, x: float, y: float) -> float:
    """Distance of a point from the carriageway's edge, negative outside (even-odd rule)."""
    inside, least2 = False, math.inf
    for i in range(len(edges)):
        dx, dy = x - edges[i, 0], y - edges[i, 1]
        wx, wy = edges[i, 2] - edges[i, 0], edges[i, 3] - edges[i, 1]
        if (y < edges[i, 1]) != (y < edges[i, 3]) and dx < wx * dy / wy:
            inside = not inside
        if edges[i, 4] != 0.0:
            share = min(max((dx * wx + dy * wy) * edges[i, 4], 0.0), 1.0)
            dx, dy = dx - share * wx, dy - share * wy
            least2 = min(least2, dx * dx + dy * dy)
    return math.sqrt(least2) if inside else -math.sqrt(least2)


@compiled
def overtakes(edges: Floats, state: Floats) -> bool:
    """Tells whether the ego passes an actor that stands or is slower.

    The actor is on the carriageway of the ego's direction, beside the ego or ahead.

    Choice: from `PASSED_M` behind the ego's rear, room to come back, to `PASSING_M` ahead of its centre.
    """
    cos, sin = math.cos(state[HEADING, 0]), math.sin(state[HEADING, 0])
    for i in range(1, state.shape[1]):
        dx, dy = state[X, i] - state[X, 0], state[Y, i] - state[Y, 0]
        ahead = dx * cos + dy * sin
        front, rear = ahead + state[LENGTH, i] / 2, ahead - state[LENGTH, i] / 2
        slower = state[SPEED, i] < max(state[SPEED, 0], STANDING_MPS)
        beside = rear < PASSING_M and front > -state[LENGTH, 0] / 2 - PASSED_M
        if slower and beside and depth(edges, state[X, i], state[Y, i]) > 0.0:
            return True
    return False


@compiled
def headway(state: Floats, kind: NDArray[np.int8], curvature: float) -> float:
    """Computes the time gap to the vehicle that the ego follows, s.

    The gap is from bumper to body, at the ego's speed.

    The corridor is as wide as the ego, along the arc that it drives now (ISO 15622 predicts the way alike). Vehicles
    that come towards it or cross at more than 60° are not followed.
    """
    cos, sin = math.cos(state[HEADING, 0]), math.sin(state[HEADING, 0])
    least = math.inf
    for i in range(1, state.shape[1]):
        dx, dy = state[X, i] - state[X, 0], state[Y, i] - state[Y, 0]
        along, across = dx * cos + dy * sin, dy * cos - dx * sin
        if abs(curvature) > 1e-4:
            radius, side = 1.0 / abs(curvature), math.copysign(1.0, curvature)
            inwards = radius - side * across
            across = side * (radius - math.hypot(along, inwards))
            along = radius * math.atan2(along, inwards)
        turn = state[HEADING, i] - state[HEADING, 0] - curvature * along
        c, s = math.cos(turn), abs(math.sin(turn))
        half_length, half_width = state[LENGTH, i] / 2, state[WIDTH, i] / 2
        if kind[i] != VEHICLE or along <= 0.0 or c < SAME_WAY_COS:
            continue
        if abs(across) < state[WIDTH, 0] / 2 + half_length * s + half_width * c:
            least = min(least, max(along - half_length * c - half_width * s - state[LENGTH, 0] / 2, 0.0))
    return float(min(least / max(state[SPEED, 0], 1e-3), HEADWAY_CAP_S))


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
    """Smallest of each measure over its actors; its cap if none."""

    ttc_s: float
    encounter_s: float
    rss_margin: float
    pedestrian_gap_m: float
    vehicle_gap_m: float


class Assessment(NamedTuple):
    """Risk measures of one frame for each of the `n` other actors."""

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
    """Whether the ego answers for each of `n` actors: ahead or alongside.

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
    """Finds the smallest RSS margin of actors the ego answers for, m.

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
        "ego_braking_mps2": max(0.0, -frame.state.item(ACCEL, 0)),
        "ego_jerk_mps3": own.ego_jerk_mps3,
        "ego_lateral_accel_mps2": own.ego_lateral_accel_mps2,
        "lane_offset_m": own.lane_offset_m,
        "over_limit_mps": own.over_limit_mps,
        "edge_m": own.edge_m,
        "carriageway_m": own.carriageway_m,
        "headway_s": own.headway_s,
    }


def red_light_margin(frame: Frame, before: Frame | None) -> float:
    """Computes the distance to the stop line of a red signal, m.

    It is `CROSSED_ON_RED_M` in the step that crosses the line.
    """
    if _crossed_on_red(frame, before):
        return CROSSED_ON_RED_M
    if frame.signal is Signal.RED:
        return min(frame.stop_line_m, GAP_CAP_M)
    return GAP_CAP_M


def red_light_braking(frame: Frame, before: Frame | None) -> float:
    """Computes the braking to stop at a red signal's line, m/s².

    It is v² / (2 d), and its cap in the step that crosses the line.
    """
    if _crossed_on_red(frame, before):
        return RED_LIGHT_BRAKING_CAP_MPS2
    if frame.signal is not Signal.RED:
        return 0.0
    room_m = max(frame.stop_line_m, 0.0) + STOP_TOLERANCE_M
    return min(frame.ego_speed_mps**2 / (2 * room_m), RED_LIGHT_BRAKING_CAP_MPS2)


def _crossed_on_red(frame: Frame, before: Frame | None) -> bool:
    """Whether the ego has just passed a red signal."""
    return before is not None and before.signal is Signal.RED and before.stop_line_m < frame.stop_line_m - 1.0
