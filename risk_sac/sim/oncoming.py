"""Moves an adversary that leaves its edge for oncoming lanes, where SUMO's `changeSublane` cannot take it.

Its command is the same as in its own lanes. The middle of its front bumper follows the command, and the rear axle
follows the front as that of a car does (kinematic bicycle model); SUMO puts it there as it puts the ego of a pilot.
"""

import math

from risk_sac.sim.paths import COS, HEADING, SIN, STATION, Along
from risk_sac.sim.pilot import Motion, MovedVehicle
from risk_sac.sim.roads import LateralRoom, Roads
from risk_sac.sim.solid import VehicleCommand
from risk_sac.world.types import HEADING as BODY_HEADING
from risk_sac.world.types import LENGTH, SPEED, STEP_S, WIDTH, Floats, X, Y

REAR_AXLE = 0.8  # Choice: distance of the rear axle from the front bumper over the body's length
OWN_EDGE_M = 0.02  # from the edge of its own lanes, at which SUMO stops taking lateral commands
STRAIGHT_RAD = 0.02  # between heading and direction of motion, up to which SUMO takes over without a jolt


class OncomingVehicle(MovedVehicle):
    """Adversary outside its own lanes, commanded by speeds along and across its path."""

    def __init__(self, vehicle: str, state: Floats, roads: Roads) -> None:
        """Takes over a vehicle, given its column of the latest frame."""
        x, y, heading, speed = (float(state[row]) for row in (X, Y, BODY_HEADING, SPEED))
        size_m = float(state[LENGTH]), float(state[WIDTH])
        super().__init__(vehicle, Motion(x, y, heading, speed), size_m, roads)
        self._command = VehicleCommand(speed, 0.0)

    def drive(self, command: VehicleCommand) -> None:
        """Commands the next step."""
        self._command = command
        self.move(driven(self.motion, self._size_m[0], self.along, command))

    def settle(self) -> None:
        """Finds it after a step of SUMO; its lateral speed is the commanded one."""
        super().settle()
        self.told = self.told._replace(lateral_mps=self._command.lateral_mps)

    def is_back(self, own: LateralRoom) -> bool:
        """Whether its body is straight and within its own lanes, given its room there."""
        turned = self.motion.heading_rad - float(self.along.path[HEADING, segment(self.along)])
        drifts = math.atan2(self._command.lateral_mps, max(self._command.speed_mps, 1e-3))
        straight = abs(math.remainder(turned - drifts, math.tau)) <= STRAIGHT_RAD
        over_m = abs(math.sin(turned)) * self._size_m[0]  # the rear may be farther out than the front
        return straight and min(own) > over_m + OWN_EDGE_M


def driven(motion: Motion, length_m: float, along: Along, command: VehicleCommand) -> Motion:
    """Computes a car's motion after a step in which the middle of its front bumper follows a command.

    ψ' = ψ + (d / l) sin(θ - ψ),   d the way of the front bumper, θ its direction, l its distance from the rear axle

    Args:
      motion: before the step.
      length_m: of its body.
      along: its place on its path before the step.
      command: speeds along and across that path.
    """
    at, half_m, before = segment(along), length_m / 2, motion.heading_rad
    cos, sin, way_rad = (float(along.path[row, at]) for row in (COS, SIN, HEADING))
    forward_m, left_m = command.speed_mps * STEP_S, command.lateral_mps * STEP_S
    front_x = motion.x_m + half_m * math.cos(before) + forward_m * cos - left_m * sin
    front_y = motion.y_m + half_m * math.sin(before) + forward_m * sin + left_m * cos
    direction = way_rad + math.atan2(left_m, forward_m) if forward_m or left_m else before
    heading = before + math.hypot(forward_m, left_m) / (REAR_AXLE * length_m) * math.sin(direction - before)
    return Motion(
        x_m=front_x - half_m * math.cos(heading),
        y_m=front_y - half_m * math.sin(heading),
        heading_rad=heading,
        speed_mps=command.speed_mps,
        accel_mps2=(command.speed_mps - motion.speed_mps) / STEP_S,
        slip_rad=direction - heading,
    )


def segment(along: Along) -> int:
    """Column of the path's segment that a vehicle is on."""
    stations = along.path[STATION]
    return min(max(int(stations.searchsorted(along.station_m, side="right")) - 1, 0), len(stations) - 1)


def leaves(own: LateralRoom, command: VehicleCommand) -> bool:
    """Whether a command takes a vehicle beyond its own lanes' left edge."""
    return command.lateral_mps * STEP_S > own.left_m - OWN_EDGE_M
