"""Bounded deviations of an actor from its story.

Choice: a deviation fades. The less an action says, the more the actor returns to the story's speed and to its place
across; the way that it lost or gained along the road stays. An action of zeros is the story from the start on.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from risk_sac.scenario.layout import Deviation
from risk_sac.scenario.limits import Limits
from risk_sac.sim.solid import clip, taper
from risk_sac.sim.story.cast import Drift, Mover
from risk_sac.world.types import STEP_S

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
