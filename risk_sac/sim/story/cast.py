"""Actors of a story: their poses, motion and deviation.

Choice: a deviation fades. The less an action says, the more the actor returns to the story's speed and to its place
across; the way that it lost or gained along the road stays. An action of zeros is the story from the start on.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from risk_sac.scenario.layout import Deviation, Reach, StoryActor
from risk_sac.scenario.limits import Limits
from risk_sac.scenario.travel_line import Pose, TravelLine
from risk_sac.sim.solid import clip, taper
from risk_sac.world.types import STEP_S

STANDS_MPS = 1e-3  # slower is no motion


class Present(NamedTuple):
    """An actor at one moment; its place is its reference point's."""

    x_m: float
    y_m: float
    heading_rad: float
    vx_mps: float
    vy_mps: float
    accel_mps2: float
    reach: Reach

    @classmethod
    def moving(cls, pose: Pose, speed_mps: float, accel_mps2: float, reach: Reach, slip_rad: float = 0.0) -> "Present":
        """Makes an actor moving along its heading, or `slip_rad` left of it."""
        way = pose.heading_rad + slip_rad
        return cls(*pose, speed_mps * math.cos(way), speed_mps * math.sin(way), accel_mps2, reach)

    def after(self, seconds: float) -> "Present":
        """Returns the pose after some time at its velocity."""
        return self._replace(x_m=self.x_m + self.vx_mps * seconds, y_m=self.y_m + self.vy_mps * seconds)

    @property
    def pose(self) -> Pose:
        """Pose of its reference point."""
        return Pose(self.x_m, self.y_m, self.heading_rad)

    @property
    def middle(self) -> tuple[float, float]:
        """Middle of its bounding box."""
        ahead_m = self.reach.ahead_m
        return self.x_m + ahead_m * math.cos(self.heading_rad), self.y_m + ahead_m * math.sin(self.heading_rad)

    @property
    def speed_mps(self) -> float:
        """Size of its velocity."""
        return math.hypot(self.vx_mps, self.vy_mps)

    def along(self, heading_rad: float) -> tuple[float, float]:
        """Its velocity along a heading and to the left of it."""
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        return self.vx_mps * cos + self.vy_mps * sin, self.vy_mps * cos - self.vx_mps * sin


class Drift(NamedTuple):
    """Deviation of an actor from its story."""

    mps: float = 0.0
    lateral_mps: float = 0.0
    ahead_m: float = 0.0
    left_m: float = 0.0
    trigger_s: float = 0.0  # shift of a trigger; of the largest deviation alone


ON_STORY = Drift()


class Mover:
    """An actor that the engine moves along a line.

    Its reference point follows the line at a lateral offset, and the body points to where that point moves.

    Attributes:
      line: that it follows.
      station_m: on the line.
      story_left_m: to the left of the line, as the story says.
      story_mps: along the line, as the story says.
      drift: from the story.
      furthest: size of each part of the drift so far.
      edges: of the net, along its route; empty without one.
      guided: whether the line is a trajectory, which lane changes leave.
      gone: whether it was deleted.
      visible: to traffic, and to sensors.
      wanted_mps: of the next step, set by the action that controls its speed; None keeps `story_mps`.
      wanted_left_m: of the next step, set by the action that controls its place across; None keeps it.
      wanted_station_m: of the next step, set by an action that says where it is; None: where its speed leads it.
    """

    line: TravelLine

    def __init__(self, name: str, start: StoryActor) -> None:
        """Takes its start; the engine puts it on a line."""
        self.name, self.reach, self.free = name, start.reach, start.free
        self.station_m = self.story_left_m = 0.0
        self.story_mps, self.accel_mps2, self.lateral_mps = start.speed_mps, 0.0, 0.0
        self.drift = self.furthest = ON_STORY
        self.edges: tuple[str, ...] = ()
        self.guided = False
        self.gone, self.visible = False, (True, True)
        self.wanted_mps: float | None = None
        self.wanted_left_m: float | None = None
        self.wanted_station_m: float | None = None

    def follow(self, line: TravelLine, station_m: float, left_m: float = 0.0) -> None:
        """Puts it on a line, at a place that includes its drift."""
        self.line, self.station_m, self.story_left_m = line, station_m, left_m - self.drift.left_m

    @property
    def speed_mps(self) -> float:
        """Along the line."""
        return self.story_mps + self.drift.mps

    @property
    def left_m(self) -> float:
        """To the left of the line."""
        return self.story_left_m + self.drift.left_m

    @property
    def pose(self) -> Pose:
        """Pose of its reference point."""
        x, y, heading = self.line.pose(self.station_m, self.left_m)
        turns = not self.free and abs(self.speed_mps) >= STANDS_MPS
        return Pose(x, y, heading + (math.atan(self.lateral_mps / self.speed_mps) if turns else 0.0))

    @property
    def present(self) -> Present:
        """Its motion as others see it."""
        way = self.line.pose(self.station_m).heading_rad
        cos, sin, speed, lateral = math.cos(way), math.sin(way), self.speed_mps, self.lateral_mps
        velocity = speed * cos - lateral * sin, speed * sin + lateral * cos
        return Present(*self.pose, *velocity, self.accel_mps2, self.reach)

    def note_shift(self, shift_s: float) -> None:
        """Notes that a trigger of its story is shifted."""
        self.furthest = self.furthest._replace(trigger_s=max(self.furthest.trigger_s, abs(shift_s)))

    @property
    def deviates(self) -> bool:
        """Whether it is off its story, or had a trigger shifted."""
        return self.drift != ON_STORY or self.furthest.trigger_s > 0.0

    def move(self, drift: Drift) -> None:
        """Moves it by a step, ending with this drift from its story."""
        before_mps, before_left_m, before = self.speed_mps, self.left_m, self.drift
        if self.wanted_station_m is not None:
            gone_m = self.wanted_station_m + drift.ahead_m - self.station_m
            self.story_mps = self.story_mps if self.wanted_mps is None else self.wanted_mps
        else:
            story_mps = self.story_mps if self.wanted_mps is None else self.wanted_mps
            gone_m = (self.story_mps + story_mps) / 2 * STEP_S + drift.ahead_m - before.ahead_m
            self.story_mps = story_mps
        self.station_m += gone_m
        self.story_left_m = self.story_left_m if self.wanted_left_m is None else self.wanted_left_m
        self.drift = drift
        self.furthest = Drift(*map(max, self.furthest, map(abs, drift)))
        self.lateral_mps = (self.left_m - before_left_m) / STEP_S
        self.accel_mps2 = (self.speed_mps - before_mps) / STEP_S
        self.wanted_mps = self.wanted_left_m = self.wanted_station_m = None


RETURN_S = 1.0  # in which a place across is returned to at most; choice
NONE_MPS, NONE_M = 1e-4, 1e-3  # of a speed and a place, which count as none


class DeviationRoom(NamedTuple):
    """Room to the left and the right of an actor's body."""

    left_m: float
    right_m: float


ANYWHERE = DeviationRoom(math.inf, math.inf)
Lead = Callable[[Mover, DeviationRoom], Drift]
"""Says how far an actor is from its story after the next step."""
NO_LEADS: Mapping[str, Lead] = {}


class DeviationControl:
    """Turns actions into an actor's drift from its story.

    The sum of story and deviation keeps the actor's limits; where the story itself exceeds one, nothing is added.
    """

    def __init__(self, bounds: Deviation, limits: Limits, *, free: bool) -> None:
        """Starts at the story.

        Args:
          bounds: of what is added.
          limits: of the actor.
          free: whether it moves as a pedestrian does.
        """
        self._bounds, self._free = bounds, free
        self._slip = math.inf if free else limits.slip
        self._lateral_mps = limits.walk_speed_mps if free else limits.lateral_mps
        self._lateral_mps2 = limits.walk_disc_mps2 if free else limits.lateral_accel_mps2
        self._jerk_mps3 = limits.walk_jerk_mps3 if free else limits.jerk_mps3
        self._most_mps = limits.walk_speed_mps if free else limits.speed_mps
        along_mps2 = math.inf if free else math.sqrt(max(limits.grip_mps2**2 - self._lateral_mps2**2, 0.0))
        self._accel_mps2 = min(limits.walk_accel_mps2 if free else limits.accel_mps2, along_mps2)
        self._brake_mps2 = min(limits.walk_brake_mps2 if free else limits.brake_mps2, along_mps2)
        self._added_mps2 = 0.0

    def step(self, drive: float, steer: float, mover: Mover, room: DeviationRoom) -> Drift:
        """The drift after the next step.

        Args:
          drive: added acceleration as a share of its bound, -1 to 1.
          steer: added speed across as a share of its bound, -1 (right) to 1 (left).
          mover: whose next step the story has said.
          room: beside it.
        """
        now = mover.drift
        mps = self._along(drive, mover)
        lateral_mps = self._across(steer, mover, room, mps)
        left_m = now.left_m + lateral_mps * STEP_S
        if steer == 0.0 and abs(left_m) < NONE_M:
            left_m = lateral_mps = 0.0
        return Drift(mps, lateral_mps, now.ahead_m + (now.mps + mps) / 2 * STEP_S, left_m)

    def _along(self, drive: float, mover: Mover) -> float:
        """The difference in speed after the step."""
        bound, now, jerk = self._bounds.accel_mps2, mover.drift.mps, self._jerk_mps3 * STEP_S
        story_mps = mover.story_mps if mover.wanted_mps is None else mover.wanted_mps
        story_mps2 = (story_mps - mover.story_mps) / STEP_S
        wanted = drive * bound + (1.0 - abs(drive)) * clip(-now / STEP_S, -bound, bound)
        wanted = clip(wanted, self._added_mps2 - jerk, self._added_mps2 + jerk)
        wanted = clip(wanted, min(-self._brake_mps2 - story_mps2, 0.0), max(self._accel_mps2 - story_mps2, 0.0))
        mps = clip(now + wanted * STEP_S, -max(story_mps, 0.0), max(self._most_mps - story_mps, 0.0))
        if drive == 0.0 and abs(mps) < NONE_MPS:
            mps = 0.0
        self._added_mps2 = (mps - now) / STEP_S
        return mps

    def _across(self, steer: float, mover: Mover, room: DeviationRoom, mps: float) -> float:
        """The difference in speed across in the step."""
        bound, now = self._bounds.lateral_mps, mover.drift
        story_left_m = mover.story_left_m if mover.wanted_left_m is None else mover.wanted_left_m
        story_mps = (story_left_m - mover.story_left_m) / STEP_S
        wanted = steer * bound + (1.0 - abs(steer)) * clip(-now.left_m / RETURN_S, -bound, bound)
        change = self._lateral_mps2 * STEP_S
        wanted = clip(wanted, now.lateral_mps - change, now.lateral_mps + change)
        speed = (mover.story_mps if mover.wanted_mps is None else mover.wanted_mps) + mps
        most = min(self._lateral_mps, self._slip * max(speed, 0.0))
        wanted = clip(wanted, min(-most - story_mps, 0.0), max(most - story_mps, 0.0))
        left_mps, right_mps = (taper(side, self._lateral_mps2) if math.isfinite(side) else math.inf for side in room)
        return clip(wanted, -right_mps, left_mps)
