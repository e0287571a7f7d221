"""Action that brings an actor to a place when another one arrives at its own."""

import math

from risk_sac.config.story_actions import SynchroniseAction
from risk_sac.sim.solid import clip
from risk_sac.sim.story.along import target_mps
from risk_sac.sim.story.cast import Mover
from risk_sac.sim.story.doing import ALONG
from risk_sac.sim.story.stage import Stage
from risk_sac.world.types import STEP_S

NO_TIME_S = 1e-6
MOST_MPS2 = 3.0  # of an actor that walks; choice


class Synchronise:
    """Lets an actor arrive at its target when the master arrives at the master's.

    The standard leaves the course of the speed open. Choice: the acceleration that changes linearly over the time that
    is left, and so the least sum of squares; it is computed again in each step from the master's present speed.
    Where a master that brakes, and then drives on, asks for more than `MOST_MPS2` in the end, the actor comes late:

      with a final speed v:   a = 6 d / T² - (4 v0 + 2 v) / T
      without one:            a = 2 (d - v0 T) / T²

    d is the way and T the time to the target or, with a steady state, to where it begins. An actor that stands waits
    while that course would lead backwards, T > 3 d / v.
    """

    controls = ALONG

    def __init__(self, do: SynchroniseAction) -> None:
        """Takes the action."""
        self._do = do

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.begin`."""
        return self._do.master not in stage.present

    def step(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.step`."""
        do = self._do
        if do.master not in stage.present:
            return True
        target, master_target = stage.pose(do.target), stage.pose(do.master_target)
        way_m = mover.line.project(*target[:2])[0] - mover.station_m
        master_m, master_mps = stage.way_to(do.master, master_target)
        if way_m <= max(float(do.tolerance_m), NO_TIME_S) or master_m <= max(float(do.master_tolerance_m), NO_TIME_S):
            if do.final_speed is not None and way_m <= 0.5:
                mover.wanted_mps = _reachable(target_mps(do.final_speed.speed, mover, stage), mover)
            return True
        time_s = master_m / master_mps if master_mps > NO_TIME_S else math.inf
        mover.wanted_mps = _reachable(self._speed_mps(mover, way_m, time_s, stage), mover)
        return way_m - (mover.story_mps + mover.wanted_mps) / 2 * STEP_S <= NO_TIME_S

    def _speed_mps(self, mover: Mover, way_m: float, time_s: float, stage: Stage) -> float:
        """Speed after the next step."""
        final, speed = self._do.final_speed, mover.story_mps
        if math.isinf(time_s):
            return speed
        if final is None:
            return max(speed + 2 * (way_m - speed * time_s) / time_s**2 * STEP_S, 0.0)
        last_mps = target_mps(final.speed, mover, stage)
        steady_m = float(final.steady_m or 0.0) + float(final.steady_s or 0.0) * last_mps
        way_m, time_s = way_m - steady_m, time_s - (steady_m / last_mps if last_mps > 0.0 else 0.0)
        if way_m <= NO_TIME_S or time_s <= STEP_S / 2:
            return last_mps
        if speed <= NO_TIME_S and last_mps > 0.0 and time_s - STEP_S / 2 > 3 * way_m / last_mps:
            return 0.0
        return max(speed + change_mps(way_m, time_s, speed, last_mps), 0.0)


def _reachable(wanted_mps: float, mover: Mover) -> float:
    """The speed nearest to a wanted one that an actor can have after a step."""
    most = MOST_MPS2 * STEP_S if mover.free else math.inf
    return clip(wanted_mps, mover.story_mps - most, mover.story_mps + most)


def change_mps(way_m: float, time_s: float, speed_mps: float, last_mps: float) -> float:
    """Change of speed in a step on the cubic course to a place, a time and a speed."""
    first = 6 * way_m / time_s**2 - (4 * speed_mps + 2 * last_mps) / time_s
    jerk = (6 * (speed_mps + last_mps) * time_s - 12 * way_m) / time_s**3
    step_s = min(STEP_S, time_s)
    return first * step_s + jerk * step_s**2 / 2
