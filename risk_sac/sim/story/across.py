"""Actions that control an actor's line or its place across it."""

import math

from risk_sac.config.story_actions import (
    AcquirePositionAction,
    AssignRouteAction,
    DistanceAction,
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
    RelativeTarget,
)
from risk_sac.scenario.travel_line import TravelLine
from risk_sac.sim.story.cast import Mover
from risk_sac.sim.story.course import Course, lateral_time_s, length_of
from risk_sac.sim.story.stage import ACROSS, ALONG, NEITHER, Stage, extent, straight
from risk_sac.world.types import STEP_S

NEAR_M = 0.02  # of a place across, within which it is reached; choice
SLOPE_S = 1e-3  # over which the speed of a timed trajectory is taken


class ChangeLane:
    """Moves an actor to another lane, whose line it then follows."""

    controls = ACROSS

    def __init__(self, do: LaneChangeAction) -> None:
        """Takes the action."""
        self._do, self._target_m, self._gone = do, float(do.offset_m), 0.0

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.begin`."""
        pose = mover.pose
        spot = stage.lane_of(self._do.target, pose)
        if spot is None:
            stage.unmet.add(f"{mover.name}: there is no such lane beside it")
            return True
        line = stage.lane_line(spot, mover.name)
        mover.follow(line, *line.project(pose.x_m, pose.y_m))
        mover.guided = False
        dynamics = self._do.dynamics
        length = length_of(dynamics, self._target_m - mover.story_left_m)
        self._course = Course(dynamics.shape, mover.story_left_m, length)
        if self._course.is_over(0.0):
            mover.story_left_m = self._target_m
            stage.look_again(mover.name)
            return True
        return False

    def step(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.step`."""
        self._gone += STEP_S if self._do.dynamics.by != "distance" else mover.speed_mps * STEP_S
        mover.wanted_left_m = self._course.value(self._gone, self._target_m)
        return self._course.is_over(self._gone)


class ChangeOffset:
    """Moves an actor to an offset from its lane's middle or trajectory."""

    controls = ACROSS

    def __init__(self, do: LaneOffsetAction) -> None:
        """Takes the action."""
        self._do, self._gone = do, 0.0

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.begin`."""
        do = self._do
        self._fixed_m = self._wanted_m(mover, stage)
        bound = None if do.lateral_mps2 is None else float(do.lateral_mps2)
        time_s = lateral_time_s(do.shape, self._fixed_m - mover.story_left_m, bound)
        self._course = Course(do.shape, mover.story_left_m, time_s)
        if self._course.is_over(0.0):
            mover.story_left_m = self._fixed_m
            stage.look_again(mover.name)
            return not do.continuous
        return False

    def _wanted_m(self, mover: Mover, stage: Stage) -> float:
        """Returns the wanted place across, m."""
        target = self._do.target
        if not isinstance(target, RelativeTarget):
            return float(target)
        if target.to not in stage.present:
            return mover.story_left_m
        _, its_m = mover.line.project(*stage.of(target.to)[:2])
        return its_m + float(target.value) if target.how == "delta" else its_m * float(target.value)

    def step(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.step`."""
        self._gone += STEP_S
        target_m = self._wanted_m(mover, stage) if self._do.continuous else self._fixed_m
        mover.wanted_left_m = self._course.value(self._gone, target_m)
        return self._course.is_over(self._gone) and not self._do.continuous


class KeepBeside:
    """Brings an actor to a distance across from another one."""

    controls = ACROSS

    def __init__(self, do: DistanceAction) -> None:
        """Takes the action."""
        self._do, self._side = do, {"left": 1.0, "right": -1.0}.get(do.displacement, 0.0)

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.begin`."""
        other = stage.present.get(self._do.to)
        if other is None:
            return True
        left_m = stage.apart(other, stage.present[mover.name], self._do.coordinates).left_m
        self._side = self._side or (1.0 if left_m >= 0.0 else -1.0)
        self._gap_m = self._gap(mover, stage) if self._do.distance_m is None else float(self._do.distance_m)
        if self._do.speed_mps is None and self._do.accel_mps2 is None:
            mover.story_left_m += self._missing_m(mover, stage)
            stage.look_again(mover.name)
            return not self._do.continuous
        return False

    def _gap(self, mover: Mover, stage: Stage) -> float:
        """Distance across on the side where the actor is to be."""
        own, other = stage.present[mover.name], stage.present[self._do.to]
        left_m = stage.apart(other, own, self._do.coordinates).left_m
        if not self._do.freespace:
            return self._side * left_m
        (low, high), (own_low, own_high) = extent(other.reach, 0.0)[1], extent(own.reach, 0.0)[1]
        return left_m + own_low - high if self._side > 0.0 else low - left_m - own_high

    def _missing_m(self, mover: Mover, stage: Stage) -> float:
        """Distance that the actor has to move to its left."""
        return self._side * (self._gap_m - self._gap(mover, stage))

    def step(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.step`."""
        do = self._do
        if do.to not in stage.present:
            return True
        missing_m = self._missing_m(mover, stage)
        speed = math.inf if do.speed_mps is None else float(do.speed_mps)
        if do.accel_mps2 is not None:
            accel = float(do.accel_mps2)
            speed = min(speed, math.sqrt(2 * accel * abs(missing_m)), abs(mover.lateral_mps) + accel * STEP_S)
        moved_m = math.copysign(min(abs(missing_m), speed * STEP_S), missing_m)
        mover.wanted_left_m = mover.story_left_m + moved_m
        return abs(missing_m) < NEAR_M and not do.continuous


class FollowTrajectory:
    """Leads an actor along a trajectory, at own speed or stated times.

    It begins on the trajectory, wherever the actor was before.
    """

    def __init__(self, do: FollowTrajectoryAction) -> None:
        """Takes the action."""
        self._do = do
        self.controls = ACROSS if do.timing is None else ACROSS | ALONG

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.begin`."""
        line, timing = stage.places.trajectory(str(self._do.trajectory), stage.of), self._do.timing
        at_m = float(self._do.from_m)
        if timing is not None and line.times_s is not None:
            self._scale = float(timing.scale)
            self._begun_s = float(timing.offset_s)
            if timing.domain == "relative":  # where it begins is passed now
                self._begun_s += stage.time_s - self._scale * line.time_s(at_m)
            self._ends_s = self._begun_s + self._scale * float(line.times_s[-1])
            at_m = max(at_m, self._station_m(line, stage.time_s))
        else:
            self._scale = 0.0
        mover.follow(line, at_m + mover.drift.ahead_m, mover.drift.left_m)
        mover.guided = True
        stage.look_again(mover.name)
        return False

    def _station_m(self, line: TravelLine, time_s: float) -> float:
        return line.station_at((time_s - self._begun_s) / self._scale)

    def step(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.step`."""
        line = mover.line
        if not self._scale:
            mover.guided = mover.station_m + mover.speed_mps * STEP_S < line.length_m
            return not mover.guided
        after_s = min(stage.time_s + STEP_S, self._ends_s)
        mover.wanted_station_m = self._station_m(line, after_s)
        mover.wanted_mps = (mover.wanted_station_m - self._station_m(line, after_s - SLOPE_S)) / SLOPE_S
        mover.guided = stage.time_s + STEP_S < self._ends_s - SLOPE_S
        return not mover.guided


class AssignRoute:
    """Leads an actor along a route from now on."""

    controls = NEITHER

    def __init__(self, do: AssignRouteAction) -> None:
        """Takes the action."""
        self._route = str(do.route)

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.begin`."""
        line, mover.edges = stage.places.route(self._route, stage.of)
        mover.follow(line, *line.project(*mover.pose[:2]))
        mover.guided = False
        return True

    def step(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.step`."""
        return True


class AcquirePosition:
    """Leads an actor to a place, along lanes or straight if free."""

    controls = NEITHER

    def __init__(self, do: AcquirePositionAction) -> None:
        """Takes the action."""
        self._position = do.position

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.begin`."""
        here, there = mover.pose, stage.pose(self._position)
        way = None if mover.free else stage.way_between(here, there)
        if way is None:
            way_rad = math.atan2(there.y_m - here.y_m, there.x_m - here.x_m)
            mover.follow(straight(here._replace(heading_rad=way_rad)), mover.drift.ahead_m)
        else:
            line, mover.edges = way
            mover.follow(line, *line.project(*here[:2]))
        mover.guided = False
        return True

    def step(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.step`."""
        return True
