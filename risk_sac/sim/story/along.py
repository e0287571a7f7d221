"""Actions that control motion along a line: speeds, distances and arrival times."""

import math

import numpy as np

from risk_sac.config.story_actions import (
    DistanceAction,
    Dynamics,
    RelativeTarget,
    SpeedAction,
    SpeedEntry,
    SpeedProfileAction,
    SynchroniseAction,
)
from risk_sac.sim.solid import clip, taper
from risk_sac.sim.story.cast import Mover, Present
from risk_sac.sim.story.course import SAME, Course, length_of
from risk_sac.sim.story.stage import ALONG, Stage, extent
from risk_sac.world.types import STEP_S

NEAR_M, NEAR_MPS = 0.05, 0.1  # of a distance and its change, within which it is reached; choice


class ChangeSpeed:
    """Brings an actor to a speed."""

    controls = ALONG

    def __init__(self, do: SpeedAction) -> None:
        """Takes the action."""
        self._target, self._dynamics = do.target, do.dynamics
        self._gone = 0.0

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.begin`."""
        self._fixed_mps = target_mps(self._target, mover, stage)
        change = self._fixed_mps - mover.story_mps
        self._course = Course(self._dynamics.shape, mover.story_mps, length_of(self._dynamics, change))
        if self._course.is_over(0.0):
            mover.story_mps = self._fixed_mps
            return not self._continues
        return False

    @property
    def _continues(self) -> bool:
        return isinstance(self._target, RelativeTarget) and self._target.continuous

    def step(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.step`."""
        self._gone += STEP_S if self._dynamics.by != "distance" else mover.speed_mps * STEP_S
        target = target_mps(self._target, mover, stage) if self._continues else self._fixed_mps
        mover.wanted_mps = self._course.value(self._gone, target)
        return self._course.is_over(self._gone) and not self._continues


def target_mps(target: "float | str | RelativeTarget", mover: Mover, stage: Stage) -> float:
    """Returns the target speed now; without the other actor, the actor's own."""
    if not isinstance(target, RelativeTarget):
        return float(target)
    other = stage.present.get(target.to)
    if other is None:
        return mover.story_mps
    value, its = float(target.value), other.along(other.heading_rad)[0]
    return its + value if target.how == "delta" else its * value


class FollowProfile:
    """Brings an actor through a series of speeds, each reached linearly.

    Choice: also in the mode that smooths the corners.
    """

    controls = ALONG

    def __init__(self, do: SpeedProfileAction) -> None:
        """Takes the action."""
        self._do, self._gone_s = do, 0.0

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.begin`."""
        self._times_s, self._speeds = [0.0], [mover.story_mps - self._others_mps(stage)]
        for entry in self._do.entries:
            change = float(entry.speed) - self._speeds[-1]
            self._times_s.append(self._times_s[-1] + self._length_s(entry, change))
            self._speeds.append(float(entry.speed))
        if self._times_s[-1] <= 0.0:
            mover.story_mps = self._speeds[-1] + self._others_mps(stage)
            return True
        return False

    def _others_mps(self, stage: Stage) -> float:
        other = stage.present.get(self._do.to) if self._do.to else None
        return 0.0 if other is None else other.along(other.heading_rad)[0]

    def _length_s(self, entry: SpeedEntry, change: float) -> float:
        if entry.time_s is not None:
            return float(entry.time_s)
        bound = self._do.accel_mps2 if change > 0.0 else self._do.brake_mps2
        return 0.0 if bound is None else length_of(Dynamics(shape="linear", by="rate", value=bound), change)

    def step(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.step`."""
        self._gone_s += STEP_S
        mover.wanted_mps = float(np.interp(self._gone_s, self._times_s, self._speeds)) + self._others_mps(stage)
        return self._gone_s >= self._times_s[-1] - SAME


class KeepAhead:
    """Brings an actor to a distance along from another one.

    Without bounds it is there at once; with bounds it closes in as fast as it can brake to the other's speed there.
    """

    controls = ALONG

    def __init__(self, do: DistanceAction) -> None:
        """Takes the action."""
        self._do, self._side = do, {"ahead": 1.0, "behind": -1.0}.get(do.displacement, 0.0)

    @property
    def _bounded(self) -> bool:
        do = self._do
        return any(bound is not None for bound in (do.accel_mps2, do.brake_mps2, do.speed_mps))

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.begin`."""
        other = stage.present.get(self._do.to)
        if other is None:
            return True
        apart = stage.apart(other, stage.present[mover.name], self._do.coordinates)
        self._side = self._side or (1.0 if apart.ahead_m >= 0.0 else -1.0)
        if self._do.distance_m is None and self._do.time_gap_s is None:
            self._fixed_m: float | None = self._gap_m(other, stage.present[mover.name], apart.ahead_m)
        else:
            self._fixed_m = None
        if not self._bounded:
            mover.station_m -= self._too_far_m(mover, other, stage)
            stage.onto_way(mover)
            stage.look_again(mover.name)
            return not self._do.continuous
        return False

    def _gap_m(self, other: Present, own: Present, ahead_m: float) -> float:
        """Returns the distance of the two on the actor's intended side."""
        if not self._do.freespace:
            return self._side * ahead_m
        (low, high), (own_low, own_high) = extent(other.reach, 0.0)[0], extent(own.reach, 0.0)[0]
        return ahead_m + own_low - high if self._side > 0.0 else low - ahead_m - own_high

    def _too_far_m(self, mover: Mover, other: Present, stage: Stage) -> float:
        """Distance of the actor ahead of its target."""
        own = stage.present[mover.name]
        gap_m = self._gap_m(other, own, stage.apart(other, own, self._do.coordinates).ahead_m)
        if self._do.time_gap_s is not None:
            wanted_m = float(self._do.time_gap_s) * abs(mover.speed_mps)
        elif self._do.distance_m is not None:
            wanted_m = float(self._do.distance_m)
        else:
            wanted_m = self._fixed_m or 0.0
        return self._side * (gap_m - wanted_m)

    def step(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.step`."""
        other = stage.present.get(self._do.to)
        if other is None:
            return True
        too_far_m = self._too_far_m(mover, other, stage)
        its_mps = other.along(mover.line.pose(mover.station_m).heading_rad)[0]
        if not self._bounded:
            mover.wanted_station_m = mover.station_m - too_far_m + its_mps * STEP_S - mover.drift.ahead_m
            mover.wanted_mps = its_mps
            return False
        accel, brake = _bound(self._do.accel_mps2), _bound(self._do.brake_mps2)
        close = brake if too_far_m < 0.0 else accel  # what ends the closing in
        closing = taper(abs(too_far_m), close) if math.isfinite(close) else abs(too_far_m) / STEP_S
        wanted = its_mps - math.copysign(closing, too_far_m)
        if self._do.speed_mps is not None:
            wanted = min(wanted, float(self._do.speed_mps))
        change = min(max(wanted - mover.story_mps, -brake * STEP_S), accel * STEP_S)
        mover.wanted_mps = max(mover.story_mps + change, 0.0)
        there = abs(too_far_m) < NEAR_M and abs(mover.story_mps - its_mps) < NEAR_MPS
        if there:
            mover.wanted_mps = its_mps
        return there and not self._do.continuous


def _bound(value: float | str | None) -> float:
    return math.inf if value is None else float(value)


NO_TIME_S = 1e-6
MOST_MPS2 = 3.0  # of an actor that walks; choice


class Synchronise:
    """Lets an actor arrive when the master does, each at its target.

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
    """Returns the speed nearest to `wanted_mps` that a step allows."""
    most = MOST_MPS2 * STEP_S if mover.free else math.inf
    return clip(wanted_mps, mover.story_mps - most, mover.story_mps + most)


def change_mps(way_m: float, time_s: float, speed_mps: float, last_mps: float) -> float:
    """Computes a step's speed change on the cubic course to a goal."""
    first = 6 * way_m / time_s**2 - (4 * speed_mps + 2 * last_mps) / time_s
    jerk = (6 * (speed_mps + last_mps) * time_s - 12 * way_m) / time_s**3
    step_s = min(STEP_S, time_s)
    return first * step_s + jerk * step_s**2 / 2
