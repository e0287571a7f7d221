"""Builds the defensive driver's view of one moment."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.jit import compiled
from risk_sac.types import SPEED, Bools, Floats, X, Y
from risk_sac.verdicts.path import pose_at, project
from risk_sac.verdicts.present import OnPath, Street
from risk_sac.verdicts.unseen import Crossings, walls_of

COMFORT_MPS2 = 3.4
DELAY_S = 0.75
BEFORE_M = 1.0  # that it stops before a place
CREEP_MPS = 2.0
OWN_LANE_M = 1.2


class Scene(NamedTuple):
    """Scene before the driver."""

    state: Floats  # rows x n, of a frame; the ego's column is not used
    vehicle: Bools
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
    scene: Scene
    street: Street
    crossings: Crossings
    placed: Floats  # 3 x n: the actors along the path, across it, and its heading there
    walls: Floats  # see `walls_of`
    eye_x: float  # of the ego's front
    eye_y: float
    step_s: float  # until it decides again


@compiled
def view_of(ego: OnPath, scene: Scene, street: Street, crossings: Crossings, step_s: float) -> View:
    """Places the actors along the path; vehicles hide what is behind them, but those that lead the ego."""
    n, state = len(scene.vehicle), scene.state
    placed, hides = np.empty((3, n)), np.zeros(n, dtype=np.bool_)
    for i in range(1, n):
        if math.isnan(state[X, i]) or not (scene.places or scene.minds[i]):
            continue
        placed[0, i], placed[1, i], placed[2, i] = project(ego.path, ego.first, state[X, i], state[Y, i])
        leads = abs(placed[1, i]) < OWN_LANE_M and placed[0, i] > ego.s and state[SPEED, i] > CREEP_MPS
        hides[i] = scene.vehicle[i] and not leads
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
    """The speed from which it stops `BEFORE_M` before a place; `stopping_m` the other way round."""
    reaction = COMFORT_MPS2 * DELAY_S
    return math.sqrt(reaction**2 + 2.0 * COMFORT_MPS2 * max(ahead_m - BEFORE_M, 0.0)) - reaction


@compiled
def held_to(view: View, ahead_m: float, passes_m: float, aside_m: float, walks_mps: float, least_mps: float) -> float:
    """The acceleration that keeps a fitting speed before a place from which a pedestrian may come.

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
