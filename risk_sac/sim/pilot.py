"""Pilots, which drive the ego in place of SUMO's models, and how SUMO is told where it is.

SUMO maps such an ego onto the nearest lane along its route, so that its drivers follow it and yield to it.
"""

import math
from typing import NamedTuple, Protocol

import libsumo

from risk_sac.jit import compiled
from risk_sac.scenario.layout import Layout
from risk_sac.sim.ego import Belief
from risk_sac.sim.lookout import project
from risk_sac.sim.paths import Along
from risk_sac.sim.reading import EgoTold
from risk_sac.types import Floats, Frame

KEEP_ROUTE = 1  # SUMO's word for the nearest place along the route
NO_LANE_CHANGE = 0


class Motion(NamedTuple):
    """A car in motion; the position is its centre's."""

    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float  # never negative
    accel_mps2: float = 0.0  # over the step before
    steering_rad: float = 0.0  # of the front wheels, positive to the left
    slip_rad: float = 0.0  # from the heading to where the centre moves


class Pilot(Protocol):
    """Drives the ego from the adversaries' release on."""

    def begin(self, layout: Layout, seed: int, frame: Frame) -> Motion:
        """Takes the ego over as it moves in the latest frame; raises `EgoFailed` if it cannot."""

    def drive(self, frame: Frame, belief: Belief, along: Along) -> Motion:
        """The ego's motion after the next step, given where it is on its path; raises `EgoFailed`."""


class MovedEgo:
    """The ego that a pilot drives, in SUMO.

    Attributes:
      motion: after its latest step.
      told: what SUMO tells of others: front bumper, compass degrees, speed, lateral speed, acceleration.
    """

    def __init__(self, vehicle: str, motion: Motion, length_m: float, points: Floats) -> None:
        self._vehicle, self._half_m = vehicle, length_m / 2
        self.motion, self.told = motion, self._told(motion, points)
        libsumo.vehicle.setLaneChangeMode(vehicle, NO_LANE_CHANGE)

    def move(self, motion: Motion, along: Along) -> None:
        """Has SUMO put it there in its next step; `along` is the ego on its path before."""
        self.motion, self.told = motion, self._told(motion, along.path)
        x, y, angle, *_ = self.told
        libsumo.vehicle.moveToXY(self._vehicle, "", -1, x, y, angle, KEEP_ROUTE)

    def settle(self) -> None:
        """After the step: SUMO derives a speed from the way along the lane, 0 where a lane begins. Followers see it."""
        libsumo.vehicle.setPreviousSpeed(self._vehicle, self.motion.speed_mps)

    def _told(self, motion: Motion, points: Floats) -> EgoTold:
        x, y, heading, speed, accel, _, slip = motion
        return _told(points, x, y, heading, speed, accel, slip, self._half_m)


@compiled
def _told(
    points: Floats, x: float, y: float, heading: float, speed: float, accel: float, slip: float, half_m: float
) -> EgoTold:
    """What SUMO would tell of a motion on a path."""
    _, _, lane_heading = project(points, x, y)
    lateral = speed * math.sin(heading + slip - lane_heading)
    front_x, front_y = x + half_m * math.cos(heading), y + half_m * math.sin(heading)
    return front_x, front_y, 90.0 - math.degrees(heading), speed, lateral, accel
