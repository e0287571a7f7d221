"""Computes how much the defensive driver speeds up or brakes.

1. It keeps a speed at which it can stop, at 3.4 m/s² after 0.75 s, before a place that it does not see. That is a place
   from which a pedestrian could come into its way before it has passed: a crossing with 2 m of waiting area at either
   end, or the kerb behind a vehicle that stands beside its path.
2. Where a vehicle stops at the crossing in another lane of its direction, all of the crossing has to be in sight.
3. It does not start or speed up while a pedestrian is within 1.5 m of its corridor. Nor does it while a pedestrian or a
   crossing vehicle would reach the corridor within 3 s. From 0.75 s after it saw a pedestrian on the carriageway or at
   a crossing it can stop before it.
4. It brakes for a conflict: with 3.4 m/s² after 0.75 s if that is enough, or else as R157's driver, until the conflict
   has been over for 1 s.

Choices: it creeps past what it cannot see, so that it never stands for ever. A pedestrian that stands with its whole
body beside the carriageway on red, or has stood there for 4 s, waits; on the carriageway the driver creeps past one
that has stood for 4 s. While the ego's signal gives it priority, a crossing is taken as empty. Traffic from across is
then expected to stop if it still can, unless it has passed its own signal. Vehicles ahead on its own lane that move
hide nothing: they go through first.

Sources: 3.4 m/s² and the 2.5 s of a driver that is not prepared: AASHTO, "A Policy on Geometric Design of Highways and
Streets" (Green Book), stopping sight distance. 0.75 s and full braking: UN R157, Annex 3; the driver is prepared.
Walking speed 1.2 m/s (4 ft/s): Highway Capacity Manual and MUTCD.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.verdicts.conflict import BRAKES_MPS2, FIRM_MPS2
from risk_sac.verdicts.course import CORRIDOR_M, YIELDING_MPS2, entry_distance, pose_at, project, with_margin
from risk_sac.verdicts.drivers import JERK_MPS3, R157_PERCEIVES_S, r157
from risk_sac.verdicts.present import (
    RED,
    Crossings,
    OnPath,
    Street,
    conflict_in,
    is_hidden,
    moving_box,
    must_yield,
    walls_of,
    within,
)
from risk_sac.world.jit import compiled
from risk_sac.world.types import ACCEL, HEADING, LENGTH, SPEED, VX, VY, WIDTH, Bools, Floats, X, Y

COMFORT_MPS2 = 3.4
DELAY_S = 0.75
BEFORE_M = 1.0  # that it stops before a place
CREEP_MPS = 2.0
OWN_LANE_M = 1.2


class SceneAhead(NamedTuple):
    """Scene before the driver."""

    state: Floats  # rows x n, of a frame; the ego's column is not used
    vehicle: Bools
    conceals: Bools  # bodies that hide what is behind them
    link: NDArray[np.uint8]
    seen: Bools
    priority: bool  # whether the ego's signal lets it go before all others
    minds: Bools  # the actors that rules 3 and 4 are asked of
    places: bool  # whether rules 1 and 2 are asked
    striker: int  # an actor in a conflict with the ego, whatever it looks like; 0: none
    strikes_s: float  # when the ego would reach it


class View(NamedTuple):
    """One moment, with all that the rules go by."""

    ego: OnPath
    front: float  # of the ego, m along its path
    scene: SceneAhead
    street: Street
    crossings: Crossings
    placed: Floats  # 3 x n: the actors along the path, across it, and its heading there
    walls: Floats  # see `walls_of`
    eye_x: float  # of the ego's front
    eye_y: float
    step_s: float  # until it decides again


@compiled
def view_of(ego: OnPath, scene: SceneAhead, street: Street, crossings: Crossings, step_s: float) -> View:
    """Places actors along the path; bodies conceal unless they lead the ego."""
    n, state = len(scene.vehicle), scene.state
    placed, hides = np.empty((3, n)), np.zeros(n, dtype=np.bool_)
    for i in range(1, n):
        if math.isnan(state[X, i]) or not (scene.places or scene.minds[i]):
            continue
        placed[0, i], placed[1, i], placed[2, i] = project(ego.path, ego.first, state[X, i], state[Y, i])
        leads = abs(placed[1, i]) < OWN_LANE_M and placed[0, i] > ego.s and state[SPEED, i] > CREEP_MPS
        hides[i] = scene.conceals[i] and not leads
    x, y, heading = pose_at(ego.path, ego.s)
    reach = ego.size.half_length
    eye_x, eye_y = x + reach * math.cos(heading), y + reach * math.sin(heading)
    return View(ego, ego.s + reach, scene, street, crossings, placed, walls_of(state, hides), eye_x, eye_y, step_s)


@compiled
def stopping_m(speed_mps: float) -> float:
    """The way in which the driver stops at leisure."""
    return speed_mps * DELAY_S + speed_mps**2 / (2.0 * COMFORT_MPS2)


@compiled
def fitting_mps(ahead_m: float) -> float:
    """Returns the speed that stops `BEFORE_M` before a place; inverts `stopping_m`."""
    reaction = COMFORT_MPS2 * DELAY_S
    return math.sqrt(reaction**2 + 2.0 * COMFORT_MPS2 * max(ahead_m - BEFORE_M, 0.0)) - reaction


@compiled
def held_to(view: View, ahead_m: float, passes_m: float, aside_m: float, walks_mps: float, least_mps: float) -> float:
    """Returns the acceleration towards `fitting_mps` before a place where pedestrians may enter.

    Args:
      view: of the moment.
      ahead_m: from the ego's front to the place.
      passes_m: what it has to drive until it has passed it with its whole body.
      aside_m: from the pedestrian to the corridor.
      walks_mps: how fast it may come.
      least_mps: the speed that it keeps anyway.
    """
    speed, step_s = view.ego.speed_mps, view.step_s
    if aside_m * speed >= walks_mps * passes_m and aside_m > 0.0:  # it has passed before anything could come
        return math.inf
    wanted = max(fitting_mps(ahead_m - speed * step_s), least_mps)
    return max((wanted - speed) / step_s, -COMFORT_MPS2)


WALKS_MPS = 1.2
KERB_MPS = 8.33  # Choice: 30 km/h past standing vehicles, away from crossings
BESIDE_M = 1.5  # of its corridor
REACHES_S = 3.0
AHEAD_M = 10.0  # it looks no less far ahead
WAITS_S = 4.0
STANDING_MPS = 0.3
OVER_S = 1.0
PASSABLE_M = 3.0  # a standing vehicle farther from the corridor hides nothing that could come out at once
BEHIND_M = 1.0  # from a standing vehicle's end to the place where a pedestrian may stand unseen
KERB_M = 2.0  # from its flank to where the kerb would be
LANES_M = 6.0  # a vehicle farther beside is in no other lane of the ego's direction
STOPS_BEFORE_M, STOPS_BEYOND_M = 12.0, 1.0  # a vehicle that stops for a crossing stands this near to its edge
AT_CROSSING_M = 2.5  # from a spot of a crossing
TOUCHES_S = 0.25
NEARS_MPS = 0.5  # an oncoming vehicle that comes nearer no faster stays on its lane
PRIORITY, PRIORITY_S = ord("G"), 4.0  # its signal, and how long it counts after the stop line
SAME_WAY_COS, ONCOMING_COS = 0.5, -0.9

# Rows of what the driver remembers of each actor.
SEEN_S, STOOD_S, SINCE_S, GONE_S, HAD_SIGNAL = range(5)


def nothing_remembered(n: int) -> Floats:
    """The driver's memory at its beginning, for `n` actors."""
    memory = np.zeros((5, n))
    memory[SINCE_S] = -1.0
    return memory


@compiled
def allowed_accel(
    ego: OnPath, scene: SceneAhead, street: Street, crossings: Crossings, memory: Floats, step_s: float
) -> float:
    """Returns the driver's largest acceleration for a step, m/s²; inf if unrestrained.

    Args:
      ego: on its path.
      scene: what it sees.
      street: where it is.
      crossings: on its path.
      memory: of the frames before, `5 x n`; it is brought up to date.
      step_s: until it decides again.
    """
    state = scene.state
    view = view_of(ego, scene, street, crossings, step_s)
    accel = _at_crossings(view) if scene.places and not scene.priority else math.inf
    for i in range(1, len(scene.vehicle)):
        if math.isnan(state[X, i]) or not scene.seen[i]:
            memory[SEEN_S, i] = memory[STOOD_S, i] = memory[GONE_S, i] = 0.0
            memory[SINCE_S, i] = -1.0
            continue
        if not scene.minds[i] and not scene.places:
            continue
        vehicle, stands, link = scene.vehicle[i], state[SPEED, i] < STANDING_MPS, int(scene.link[i])
        memory[SEEN_S, i] += step_s
        memory[STOOD_S, i] = memory[STOOD_S, i] + step_s if stands else 0.0
        memory[HAD_SIGNAL, i] = 1.0 if link != 0 else memory[HAD_SIGNAL, i]
        if scene.places and scene.conceals[i] and stands:
            accel = min(accel, _past_standing(view, i))
        if not scene.minds[i]:
            continue
        approaches = memory[HAD_SIGNAL, i] == 0.0 and not within(street.junctions, state[X, i], state[Y, i])
        if vehicle and scene.priority and approaches:  # the ego's signal says that it has to stop
            link = RED
        touch_s = conflict_in(ego, state, i, vehicle, link, street, False)
        if i == scene.striker:
            touch_s = min(touch_s, scene.strikes_s)
        accel = min(accel, _in_conflict(ego.speed_mps, touch_s, street.grip_mps2, memory[:, i], step_s))
        if not vehicle:
            accel = min(accel, _beside(view, i, memory[:, i]))
        elif accel > 0.0 and not stands and _comes_across(view, i, link):
            accel = 0.0
    return accel


@compiled
def _at_crossings(view: View) -> float:
    """Applies rules 1 and 2: crossings ahead with places out of sight."""
    ego, crossings = view.ego, view.crossings
    accel, looks_m, asked, stopped_for = math.inf, stopping_m(ego.speed_mps) + AHEAD_M, -1.0, False
    for k in range(len(crossings.spots)):
        spot_x, spot_y, crossing, aside = crossings.spots[k]
        enters, leaves = crossings.entries[int(crossing)]
        ahead = enters - view.front
        if not 0.0 <= ahead <= looks_m or not is_hidden(view.walls, view.eye_x, view.eye_y, spot_x, spot_y):
            continue
        if crossing != asked:
            asked, stopped_for = crossing, _is_stopped_for(view.scene, view.placed, enters)
        aside = 0.0 if stopped_for else aside
        passes = leaves - view.front + 2.0 * ego.size.half_length
        accel = min(accel, held_to(view, ahead, passes, aside, WALKS_MPS, CREEP_MPS))
    return accel


@compiled
def _is_stopped_for(scene: SceneAhead, placed: Floats, enters_m: float) -> bool:
    """Whether a same-direction vehicle in another lane stops for a crossing."""
    state = scene.state
    for i in range(1, len(scene.vehicle)):
        if not scene.vehicle[i] or not scene.seen[i] or math.isnan(state[X, i]):
            continue
        beside = OWN_LANE_M < abs(placed[1, i]) < LANES_M
        if not beside or math.cos(state[HEADING, i] - placed[2, i]) < SAME_WAY_COS or must_yield(int(scene.link[i])):
            continue
        room, speed, braking = enters_m - placed[0, i] - state[LENGTH, i] / 2, state[SPEED, i], -state[ACCEL, i]
        if speed >= STANDING_MPS:
            if braking < BRAKES_MPS2:
                continue
            room -= speed**2 / (2.0 * braking)
        if -STOPS_BEYOND_M <= room <= STOPS_BEFORE_M:
            return True
    return False


@compiled
def _past_standing(view: View, i: int) -> float:
    """Rule 1: the kerb behind a vehicle that stands beside the path."""
    ego, state, street = view.ego, view.scene.state, view.street
    along, across, heading = view.placed[0, i], view.placed[1, i], view.placed[2, i]
    cos, sin = abs(math.cos(state[HEADING, i] - heading)), abs(math.sin(state[HEADING, i] - heading))
    half_length = state[LENGTH, i] / 2 * cos + state[WIDTH, i] / 2 * sin
    half_width = state[LENGTH, i] / 2 * sin + state[WIDTH, i] / 2 * cos
    aside = abs(across) - half_width - ego.size.half_width - CORRIDOR_M
    end = along + half_length
    if not 0.0 < aside < PASSABLE_M or not 0.0 < end - view.front < stopping_m(ego.speed_mps) + AHEAD_M:
        return math.inf
    x, y, way = pose_at(ego.path, end + BEHIND_M)
    side = math.copysign(1.0, across)
    kerb = across + side * (half_width + KERB_M)
    kerb_x, kerb_y = x - kerb * math.sin(way), y + kerb * math.cos(way)
    if len(street.roadway.sides) == 0 or within(street.roadway, kerb_x, kerb_y):
        return math.inf
    if not is_hidden(view.walls, view.eye_x, view.eye_y, x - across * math.sin(way), y + across * math.cos(way)):
        return math.inf
    passes = end + BEHIND_M - view.front + 2.0 * ego.size.half_length
    return held_to(view, end - view.front, passes, aside, WALKS_MPS, KERB_MPS)


@compiled
def _beside(view: View, i: int, remembered: Floats) -> float:
    """Rule 3 for a pedestrian."""
    ego, state, roadway = view.ego, view.scene.state, view.street.roadway
    along, across, heading = view.placed[0, i], view.placed[1, i], view.placed[2, i]
    x, y, body = state[X, i], state[Y, i], state[WIDTH, i] / 2
    ahead, aside = along - body - view.front, abs(across) - body - ego.size.half_width - CORRIDOR_M
    if ahead + 2.0 * body < 0.0 or ahead > stopping_m(ego.speed_mps) + AHEAD_M:
        return math.inf
    comes_mps = _nearing_mps(state, i, across, heading)
    if aside > BESIDE_M and aside > comes_mps * REACHES_S:
        return math.inf
    on_road = len(roadway.sides) == 0 or within(roadway, x, y, body)
    stood, on_red = remembered[STOOD_S] >= WAITS_S - 1e-6, int(view.scene.link[i]) == RED
    if not on_road and (stood or (on_red and remembered[STOOD_S] > 0.0)):
        return math.inf
    leaves = comes_mps < -STANDING_MPS
    if leaves or remembered[SEEN_S] < DELAY_S - 1e-6 or not (on_road or _is_at(view.crossings, x, y)):
        return 0.0
    passes = ahead + 2.0 * (body + ego.size.half_length)
    least = CREEP_MPS if stood and aside > 0.0 else 0.0
    return min(held_to(view, ahead, passes, aside, max(comes_mps, WALKS_MPS), least), 0.0)


@compiled
def _nearing_mps(state: Floats, i: int, across: float, heading: float) -> float:
    left_mps: float = state[VY, i] * math.cos(heading) - state[VX, i] * math.sin(heading)
    return -math.copysign(1.0, across) * left_mps


@compiled
def _is_at(crossings: Crossings, x: float, y: float) -> bool:
    """Whether a place is on a crossing or its waiting area."""
    for k in range(len(crossings.spots)):
        if math.hypot(crossings.spots[k, 0] - x, crossings.spots[k, 1] - y) < AT_CROSSING_M:
            return True
    return False


@compiled
def _comes_across(view: View, i: int, link: int) -> bool:
    """Checks rule 3: a crossing vehicle reaches the corridor within 3 s.

    One that has to yield and still can is expected to, and so is one that brakes already.
    """
    ego, state = view.ego, view.scene.state
    across, heading = view.placed[1, i], view.placed[2, i]
    turn = math.cos(state[HEADING, i] - heading)
    if turn > SAME_WAY_COS:
        return False
    if turn < ONCOMING_COS and abs(across) > OWN_LANE_M and _nearing_mps(state, i, across, heading) < NEARS_MPS:
        return False
    speed = state[SPEED, i]
    reach = max(ego.speed_mps * REACHES_S, AHEAD_M)
    apart = math.hypot(state[X, i] - state[X, 0], state[Y, i] - state[Y, 0])
    if apart > reach + speed * REACHES_S + state[LENGTH, i] + 2.0 * ego.size.half_length:
        return False
    other = moving_box(state, i)
    times = np.arange(0.0, REACHES_S + TOUCHES_S / 2, TOUCHES_S)
    x, y, heading = other.x + times * other.vx, other.y + times * other.vy, np.full(len(times), other.heading)
    last = ego.s + ego.size.half_length + reach
    gone, _ = entry_distance(ego.path, ego.first, last, with_margin(ego.size), x, y, heading, other.size)
    yields = must_yield(link) and gone > speed**2 / (2.0 * YIELDING_MPS2)
    yields = yields or (state[ACCEL, i] <= -BRAKES_MPS2 and gone > speed**2 / (2.0 * FIRM_MPS2))
    return math.isfinite(gone) and not yields


@compiled
def _in_conflict(speed_mps: float, touch_s: float, grip_mps2: float, remembered: Floats, step_s: float) -> float:
    """Applies rule 4 for the time to an actor; updates its memory."""
    if touch_s < math.inf:
        remembered[SINCE_S] = 0.0 if remembered[SINCE_S] < 0.0 else remembered[SINCE_S] + step_s
        remembered[GONE_S] = 0.0
    elif remembered[SINCE_S] >= 0.0:
        remembered[SINCE_S] += step_s
        remembered[GONE_S] += step_s
        if remembered[GONE_S] > OVER_S + 1e-6:
            remembered[SINCE_S] = -1.0
    since = remembered[SINCE_S]
    if since < 0.0:
        return math.inf
    braking = min(max(JERK_MPS3 * (since - DELAY_S), 0.0), COMFORT_MPS2, grip_mps2)
    room = max(speed_mps * touch_s - BEFORE_M, 0.01)
    if since >= R157_PERCEIVES_S and speed_mps**2 / (2.0 * room) > COMFORT_MPS2:
        braking = max(braking, r157(since - R157_PERCEIVES_S, grip_mps2))
    return -braking if braking > 0.0 else math.inf
