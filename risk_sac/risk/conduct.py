"""Soft realism cost: how unlikely the adversaries' behaviour is, step by step.

Every scale is absolute, so that the same motion costs the same under every preset of limits. A scale with a published
distribution in `risk_sac.risk.driving` runs from 0 at a value that 1 of 100 road users exceeds to 1 at one that 1 of
10,000 exceeds; the others are choices.

A policy can foresee its cost only if it knows what the cost remembers: `ADVERSARY_MEMORY` numbers of each adversary,
which the observation holds. What the signals did follows from the scene and the time, which it holds too.

Features of `risk_sac.risk.driving` without a step-by-step form: the duration of a lane change, which is known at its
end (the lateral speed stands for it); the room to the new follower as a time to collision; the pedestrian's accepted
gap and entry on red, whose way and crossing a frame does not tell; and turning, which every walker may do at rest.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.maps.carriageway import SQUARE_M, Carriageway, square_of
from risk_sac.risk.driving import FEATURES
from risk_sac.risk.publish import nearest_lane
from risk_sac.scenario.layout import Layout
from risk_sac.world.jit import compiled
from risk_sac.world.types import (
    ACCEL,
    HEADING,
    LATERAL,
    LENGTH,
    OFFSET,
    SPEED,
    STEP_S,
    VX,
    VY,
    WIDTH,
    Floats,
    Kind,
    X,
    Y,
)

ORDINARY, IMPLAUSIBLE = 1e-2, 1e-4  # tail probabilities at which a cost begins, and at which it is 1

PEDESTRIAN = int(Kind.PEDESTRIAN)  # compiled code knows no enums of int8

# Rows of the memory, one column for each adversary.
PEDAL = 0  # which pedal was pressed last: 1 gas, -1 brake, 0 none yet
CHANGES = 1  # changes between the pedals; fades with CHANGES_S
LEVEL = 2  # s, how long it has worked to stay level with a vehicle, or has been close beside one
OVER = 3  # s, how long it has kept to a line or over it
IDLE = 4  # s, how long it has stood or crawled without a reason; below 0, how badly it entered its junction
HELD = 5  # m/s², mean acceleration of about the last HELD_S
ADVERSARY_MEMORY = 6
# Rows that follow from the scene and the time.
LINK = 6  # SUMO's letter of the signal ahead in the step before
RED = 7  # s, how long that signal has been red
CONDUCT_ROWS = 8
MEMORY_SCALE = np.array([1.0, 3.0, 5.0, 5.0, 5.0, 8.0])  # of each row in an observation

CHANGES_S = 10.0  # choice: over which changes of pedal are forgotten
HELD_S = 0.5  # choice: SUMO's drivers touch a pedal for a step or two
PEDAL_MPS2, STEPS_OUT_MPS2 = 0.5, 0.5  # choice: from there a pedal is pressed, and a pedestrian starts or stops
FORGET = 2.0  # choice: timers run back twice as fast as they ran up, so that a short swerve does not reset them


def _quantile(name: str, probability: float) -> float:
    """Finds the value at which a published feature has this tail probability."""
    feature = FEATURES[name]
    assert feature.spread is not None
    tail = feature.spread.above if feature.unlikely == "above" else feature.spread.below
    low, high = (0.0, 100.0) if feature.unlikely == "above" else (100.0, -100.0)  # from likely to unlikely
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if tail(middle) > probability else (low, middle)
    return (low + high) / 2


def _scale(name: str) -> tuple[float, float]:
    return _quantile(name, ORDINARY), _quantile(name, IMPLAUSIBLE)


BRAKING_FREE, BRAKING_FULL = _scale("braking")  # 5.8 to 8.4 m/s²
ACCELERATION_FREE, ACCELERATION_FULL = _scale("acceleration")  # 3.6 to 4.1 m/s²
GAP_FREE, GAP_FULL = _scale("lane_change_gap")  # 1.9 to 0.8 m
HEADWAY_FREE, HEADWAY_FULL = _scale("lane_change_headway")  # 0.25 to 0.11 s
WALKING_FREE, WALKING_FULL = _scale("walking_speed")  # 1.9 to 2.3 m/s
RIDING_FREE, RIDING_FULL = _scale("riding_speed")  # 8.2 to 11.6 m/s
SPEEDING_FREE, SPEEDING_FULL = _scale("speeding")  # 6.5 to 10.1 m/s above the limit
RED_FREE, RED_FULL = _scale("red_entry")  # 0 to 2.9 s after the start of red
ENTRY_GAP_FREE, ENTRY_GAP_FULL = _scale("junction_gap")  # 1.9 to -2.8 s: 1.6 of 1,000 drivers accept 0 s
# Choices, where nothing is published: what SUMO's drivers stay below costs nothing.
CHANGES_FREE, CHANGES_FULL = 2.4, 3.6
LATERAL_FREE, LATERAL_FULL = 1.0, 1.8  # m/s; UN R157's fastest cut-in
LEVEL_FREE, LEVEL_FULL = 1.5, 4.0  # s
OVER_FREE, OVER_FULL = 0.5, 2.0  # s
IDLE_FREE, IDLE_FULL = 2.0, 5.0  # s
JERK_FREE, JERK_FULL = 10.0, 20.0  # m/s³ of the held acceleration
TOWARDS_FREE, TOWARDS_FULL = 0.5, 0.9  # cosine of the walking direction with the way back to the car

OVERLOOKS = 0.5  # choice: the most that a cut-in or an entry costs, since drivers overlook cars and signals
NEAR_LINE_M = 0.15  # from the body's side to the line
CALM_MPS = 0.5  # slower across, a vehicle is not changing lanes
LEVEL_MPS, LEVEL_ASIDE_M = 1.0, 2.5  # difference of speeds, and room between the bodies, of vehicles that are level
CLOSE_ASIDE_M, WORKING_MPS2 = 1.0, 0.5  # cars in lanes side by side leave 1.5 m; cruising takes no acceleration
MOVING_MPS = 2.0
CRAWLS_MPS = 3.0  # choice: slower in a junction, a vehicle crawls; SUMO's drivers do so for a second when they start
SAME_WAY_COS = 0.9
STANDING_MPS = 0.5
CLEAR_M = 12.0  # free way ahead that gives no reason to stand
AHEAD_M = 30.0  # how far ahead of the car a pedestrian is in its way
BESIDE_M = 1.0  # closer than that, a pedestrian beside the car walks into it
WALKING_MPS = 0.3
RIDDEN_M = 1.0  # longer than this, a body that moves freely is ridden
STOP, WAIT, YIELD, GO = ord("r"), ord("u"), ord("g"), ord("G")  # letters of signals
NEAR_M = 20.0  # choice: from the ego, over which an adversary counts for 1 / e
MIDDLE_M, ACROSS_M = 10.0, 8.0  # choice: from where a vehicle enters to where ways meet, and how far these lie apart

# Terms of the cost.
PEDALS, ACCELERATION, LATERAL_SPEED, OVER_LINE, PACING, CUT_IN, STANDING, WALKING, TOWARDS_CAR = range(9)
JERK, SPEEDING, ENTRY = range(9, 12)
TERMS = 12


class RoadFacts(NamedTuple):
    """Facts of the road that the cost depends on."""

    lane_width_m: Floats  # of the lane of each adversary
    limit_mps: Floats  # of that lane
    junctions: Floats  # a row nx, ny, c and number of its junction for each side of one; nx·x + ny·y <= c within


class LanesNear(NamedTuple):
    """Road around the adversaries, for compiled code."""

    lanes: Floats  # segments of lanes around one adversary after the other, see `Surroundings`
    first: NDArray[np.intp]  # of each adversary its first segment, then their number
    usual: tuple[float, float]  # lane width and limit where no lane is near
    junctions: Floats  # as in `RoadFacts`


class ConductRoad:
    """Road of an episode."""

    def __init__(self, layout: Layout, limit_mps: float, carriageway: Carriageway) -> None:
        """Takes a layout, the limit off its lanes, and its net's carriageway."""
        sides = [(*side, float(k)) for k, area in enumerate(layout.junctions) for side in area.sides]
        self._junctions = np.array(sides).reshape(-1, 4)
        self._usual = float(layout.lane_width_m), float(limit_mps)
        self._carriageway = carriageway
        self._squares = np.empty((0, 2), dtype=np.intp)  # of the adversaries
        self._near = LanesNear(np.empty((0, 7)), np.zeros(1, dtype=np.intp), self._usual, self._junctions)

    def near(self, rows: NDArray[np.intp], state: Floats) -> LanesNear:
        """Looks up the road around the adversaries; arguments as of `conduct_terms`."""
        if not _in_squares(self._squares, rows, state):  # seldom: a vehicle drives for seconds in the same square
            squares = [square_of(state.item(X, row), state.item(Y, row)) for row in rows.tolist()]
            around = [self._carriageway.lanes(square) for square in squares]
            self._squares = np.array(squares, dtype=np.intp).reshape(-1, 2)
            first = np.cumsum([0, *map(len, around)], dtype=np.intp)
            self._near = LanesNear(np.concatenate([np.empty((0, 7)), *around]), first, self._usual, self._junctions)
        return self._near


@compiled
def _in_squares(squares: NDArray[np.intp], rows: NDArray[np.intp], state: Floats) -> bool:
    """Whether each of `rows` is in its square."""
    if len(squares) != len(rows):
        return False
    for k in range(len(rows)):
        if state[X, rows[k]] // SQUARE_M != squares[k, 0] or state[Y, rows[k]] // SQUARE_M != squares[k, 1]:
            return False
    return True


@compiled
def road_facts(
    rows: NDArray[np.intp],
    state: Floats,
    lanes: Floats,
    first: NDArray[np.intp],
    usual: tuple[float, float],
    junctions: Floats,
) -> RoadFacts:
    """Finds each adversary's lane by `LanesNear`; arguments as of `conduct_terms`."""
    width_m, limit_mps = np.empty(len(rows)), np.empty(len(rows))
    for k in range(len(rows)):
        row = rows[k]
        around = lanes[first[k] : first[k + 1]]
        _, limit, width = nearest_lane(around, state[X, row], state[Y, row], state[HEADING, row])
        width_m[k], limit_mps[k] = (width, limit) if math.isfinite(limit) else usual
    return RoadFacts(width_m, limit_mps, junctions)


@compiled
def conduct_cost(
    rows: NDArray[np.intp],
    slots: NDArray[np.intp],
    kind: NDArray[np.int8],
    link: NDArray[np.uint8],
    state: Floats,
    memory: Floats,
    lanes: Floats,
    first: NDArray[np.intp],
    usual: tuple[float, float],
    junctions: Floats,
) -> float:
    """Computes a step's soft realism cost; arguments as of `conduct_terms` and `LanesNear`."""
    road = road_facts(rows, state, lanes, first, usual, junctions)
    return soft_cost(conduct_terms(rows, slots, kind, link, state, memory, road), rows, state)


@compiled
def _in_junction(row: int, state: Floats, junctions: Floats) -> bool:
    """Whether a vehicle has its front in a junction."""
    x = state[X, row] + state[LENGTH, row] / 2 * math.cos(state[HEADING, row])
    y = state[Y, row] + state[LENGTH, row] / 2 * math.sin(state[HEADING, row])
    inside = True
    for i in range(len(junctions)):
        if i > 0 and junctions[i, 3] != junctions[i - 1, 3]:
            if inside:
                return True
            inside = True
        inside = inside and junctions[i, 0] * x + junctions[i, 1] * y <= junctions[i, 2]
    return inside and len(junctions) > 0


@compiled
def ramp(value: float, free: float, full: float) -> float:
    """Clips (value - free) / (full - free) to [0, 1]."""
    return min(max((value - free) / (full - free), 0.0), 1.0)


@compiled
def _run(timer_s: float, on: bool) -> float:
    return timer_s + STEP_S if on else max(timer_s - FORGET * STEP_S, 0.0)


@compiled
def conduct_terms(
    rows: NDArray[np.intp],
    slots: NDArray[np.intp],
    kind: NDArray[np.int8],
    link: NDArray[np.uint8],
    state: Floats,
    memory: Floats,
    road: RoadFacts,
) -> Floats:
    """Computes a step's cost terms, `adversaries x TERMS`, each in [0, 1].

    Args:
      rows: columns of the adversaries in `state`.
      slots: their columns in `memory`.
      kind: `n`.
      link: `n`, SUMO's letter of the signal ahead of each actor.
      state: `rows x n`, after the step.
      memory: `CONDUCT_ROWS x adversaries`; updated.
      road: where each of `rows` is.
    """
    terms = np.zeros((len(rows), TERMS))
    for k in range(len(rows)):
        row, slot = rows[k], slots[k]
        if kind[row] == PEDESTRIAN:
            _pedestrian(row, state, memory[:, slot], terms[k])
        else:
            lane = road.lane_width_m[k], road.limit_mps[k]
            _vehicle(row, kind, link, state, memory[:, slot], lane, road.junctions, terms[k])
            _enter(row, kind, link, state, memory[:, slot], terms[k])
    return terms


@compiled
def soft_cost(terms: Floats, rows: NDArray[np.intp], state: Floats) -> float:
    """Computes a step's soft realism cost from its terms, in [0, 1].

    C_soft(s, a) = min(1, Σ_k exp(-d_k / NEAR_M) · min(1, Σ_i c_ki))                    (5)

    c_ki is term i of adversary k, and d_k its distance from the ego. Unlikely things add up, as the logarithms of
    their probabilities do. Choice: what happens far from the ego counts less, since it does not make the failure.

    Args:
      terms: `adversaries x TERMS`.
      rows: columns of the adversaries in `state`; the ego's is 0.
      state: `rows x n`.
    """
    cost = 0.0
    for k in range(len(rows)):
        away_m = math.hypot(state[X, rows[k]] - state[X, 0], state[Y, rows[k]] - state[Y, 0])
        cost += math.exp(-away_m / NEAR_M) * min(terms[k].sum(), 1.0)
    return min(cost, 1.0)


@compiled
def see_signals(rows: NDArray[np.intp], slots: NDArray[np.intp], link: NDArray[np.uint8], memory: Floats) -> None:
    """Notes the signals ahead before a step; arguments as of `conduct_terms`."""
    for k in range(len(rows)):
        _see(link[rows[k]], memory[:, slots[k]])


@compiled
def _see(letter: int, memory: Floats) -> None:
    memory[RED] = memory[RED] + STEP_S if letter in (STOP, WAIT) else 0.0
    memory[LINK] = letter


@compiled
def _enter(
    row: int, kind: NDArray[np.int8], link: NDArray[np.uint8], state: Floats, memory: Floats, terms: Floats
) -> None:
    """Judges an entry into a junction: on red, or against priority."""
    if memory[LINK] != 0.0 and link[row] == 0 and state[SPEED, row] > STANDING_MPS:
        badly = 0.0
        if memory[LINK] in (STOP, WAIT):
            badly = ramp(memory[RED], RED_FREE, RED_FULL)
        elif memory[LINK] == YIELD:
            badly = ramp(_priority_s(row, kind, link, state), ENTRY_GAP_FREE, ENTRY_GAP_FULL)
        memory[IDLE] = min(memory[IDLE], -badly * IDLE_FULL) if badly > 0.0 else memory[IDLE]
    terms[ENTRY] = OVERLOOKS * min(max(-memory[IDLE] / IDLE_FULL, 0.0), 1.0)
    _see(link[row], memory)


@compiled
def _priority_s(row: int, kind: NDArray[np.int8], link: NDArray[np.uint8], state: Floats) -> float:
    """Computes when the first vehicle with priority reaches a junction's middle, s.

    It keeps its speed and direction; infinite if none comes.
    """
    x = state[X, row] + MIDDLE_M * math.cos(state[HEADING, row])
    y = state[Y, row] + MIDDLE_M * math.sin(state[HEADING, row])
    soonest_s = math.inf
    for other in range(state.shape[1]):
        if other == row or kind[other] == PEDESTRIAN or link[other] != GO or state[SPEED, other] < STANDING_MPS:
            continue
        cos, sin = math.cos(state[HEADING, other]), math.sin(state[HEADING, other])
        dx, dy = x - state[X, other], y - state[Y, other]
        along, across = dx * cos + dy * sin, dy * cos - dx * sin
        if along > 0.0 and abs(across) < ACROSS_M:
            soonest_s = min(soonest_s, along / state[SPEED, other])
    return soonest_s


@compiled
def _count_changes(accel: float, pressed: float, memory: Floats) -> None:
    memory[HELD] += (accel - memory[HELD]) * STEP_S / HELD_S
    pedal = 1.0 if memory[HELD] > pressed else -1.0 if memory[HELD] < -pressed else 0.0
    memory[CHANGES] *= math.exp(-STEP_S / CHANGES_S)
    if pedal != 0.0:
        if pedal == -memory[PEDAL]:
            memory[CHANGES] += 1.0
        memory[PEDAL] = pedal


@compiled
def _vehicle(
    row: int,
    kind: NDArray[np.int8],
    link: NDArray[np.uint8],
    state: Floats,
    memory: Floats,
    lane: tuple[float, float],
    junctions: Floats,
    terms: Floats,
) -> None:
    accel, speed, lateral = state[ACCEL, row], state[SPEED, row], state[LATERAL, row]
    terms[JERK] = ramp(abs(accel - memory[HELD]) / HELD_S, JERK_FREE, JERK_FULL)
    terms[SPEEDING] = ramp(speed - lane[1], SPEEDING_FREE, SPEEDING_FULL)
    _count_changes(accel, PEDAL_MPS2, memory)
    to_line = lane[0] / 2 - abs(state[OFFSET, row]) - state[WIDTH, row] / 2
    moves, changes_lane = speed > MOVING_MPS, abs(lateral) > CALM_MPS
    cos, sin = math.cos(state[HEADING, row]), math.sin(state[HEADING, row])
    level, paces, clear = False, False, True
    for other in range(state.shape[1]):
        if other == row:
            continue
        dx, dy = state[X, other] - state[X, row], state[Y, other] - state[Y, row]
        along, across = dx * cos + dy * sin, dy * cos - dx * sin
        half_m = (state[LENGTH, row] + state[LENGTH, other]) / 2
        half_width = (state[WIDTH, row] + state[WIDTH, other]) / 2
        if half_m - 1.0 < along < half_m + CLEAR_M and abs(across) < half_width + CLEAR_M / 2:
            clear = False
        same_way = math.cos(state[HEADING, other] - state[HEADING, row]) > SAME_WAY_COS
        aside = abs(across) - half_width
        if kind[other] == PEDESTRIAN or not same_way or aside > LEVEL_ASIDE_M or along > half_m:
            continue
        behind = -along - half_m  # negative while the two are side by side
        if behind < 0.0 and moves and abs(state[SPEED, other] - speed) < LEVEL_MPS:
            level = True
            paces = paces or abs(accel) > WORKING_MPS2 or aside < CLOSE_ASIDE_M
        towards = lateral if across > 0.0 else -lateral
        if to_line < 0.0 and towards > CALM_MPS and state[SPEED, other] > MOVING_MPS and aside > -half_width / 2:
            near = max(ramp(behind, GAP_FREE, GAP_FULL), ramp(behind / state[SPEED, other], HEADWAY_FREE, HEADWAY_FULL))
            terms[CUT_IN] = max(terms[CUT_IN], OVERLOOKS * near)
    memory[OVER] = _run(memory[OVER], moves and to_line < NEAR_LINE_M and not changes_lane)
    if paces or not level:  # two that cruise side by side do not pace each other
        memory[LEVEL] = _run(memory[LEVEL], paces)
    within = _in_junction(row, state, junctions)
    idles = (speed < STANDING_MPS and (link[row] == 0 or link[row] == GO)) or (within and speed < CRAWLS_MPS)
    if memory[IDLE] >= 0.0:
        memory[IDLE] = _run(memory[IDLE], idles and clear)
    elif not within:  # it leaves the junction that it entered badly
        memory[IDLE] = min(memory[IDLE] + FORGET * STEP_S, 0.0)
    terms[PEDALS] = ramp(memory[CHANGES], CHANGES_FREE, CHANGES_FULL)
    terms[ACCELERATION] = max(
        ramp(-accel, BRAKING_FREE, BRAKING_FULL), ramp(accel, ACCELERATION_FREE, ACCELERATION_FULL)
    )
    terms[LATERAL_SPEED] = ramp(abs(lateral), LATERAL_FREE, LATERAL_FULL)
    terms[OVER_LINE] = ramp(memory[OVER], OVER_FREE, OVER_FULL)
    terms[PACING] = ramp(memory[LEVEL], LEVEL_FREE, LEVEL_FULL)
    terms[STANDING] = ramp(memory[IDLE], IDLE_FREE, IDLE_FULL)


@compiled
def _pedestrian(row: int, state: Floats, memory: Floats, terms: Floats) -> None:
    speed = state[SPEED, row]
    _count_changes(state[ACCEL, row], STEPS_OUT_MPS2, memory)
    cos, sin = math.cos(state[HEADING, 0]), math.sin(state[HEADING, 0])
    dx, dy = state[X, row] - state[X, 0], state[Y, row] - state[Y, 0]
    ahead, aside = dx * cos + dy * sin, dy * cos - dx * sin
    half_m, half_width = state[LENGTH, 0] / 2, state[WIDTH, 0] / 2
    to_front, to_side = ahead - half_m, abs(aside) - half_width
    in_way = 0.0 < to_front < AHEAD_M and to_side < half_width / 2 and state[SPEED, 0] > STANDING_MPS
    memory[IDLE] = _run(memory[IDLE], in_way and speed < WALKING_MPS)
    terms[PEDALS] = ramp(memory[CHANGES], CHANGES_FREE, CHANGES_FULL)
    if state[LENGTH, row] > RIDDEN_M:
        terms[WALKING] = ramp(speed, RIDING_FREE, RIDING_FULL)
    else:
        terms[WALKING] = ramp(speed, WALKING_FREE, WALKING_FULL)
    terms[STANDING] = ramp(memory[IDLE], IDLE_FREE, IDLE_FULL)
    if speed < WALKING_MPS:
        return
    if in_way:
        terms[TOWARDS_CAR] = ramp(-math.cos(state[HEADING, row] - state[HEADING, 0]), TOWARDS_FREE, TOWARDS_FULL)
    into_side = (state[VY, row] * cos - state[VX, row] * sin) * (-1.0 if aside > 0.0 else 1.0)
    if abs(ahead) < half_m and 0.0 <= to_side < BESIDE_M and into_side > STANDING_MPS:
        terms[TOWARDS_CAR] = 1.0 - to_side / BESIDE_M
