"""Drives vehicles in place of SUMO's models.

They are the ego of a pilot, and oncoming adversaries; SUMO puts them where they are.

SUMO maps such a vehicle onto the nearest lane along its route, so that its drivers follow it and yield to it. Where the
whole body is beside these lanes, on an oncoming lane or off the road, SUMO keeps it where it is, on no lane.
"""

import math
from typing import NamedTuple, Protocol

import libsumo

from risk_sac.scenario.layout import Layout
from risk_sac.sim.ego import Belief
from risk_sac.sim.lookout import project, stretch
from risk_sac.sim.paths import COS, HEADING, SIN, STATION, Along, PathStopLine
from risk_sac.sim.reading import PlacedState
from risk_sac.sim.roads import LateralRoom, Roads
from risk_sac.sim.solid import VehicleCommand
from risk_sac.world.jit import compiled
from risk_sac.world.types import HEADING as BODY_HEADING
from risk_sac.world.types import LENGTH, SPEED, STEP_S, WIDTH, Floats, Frame, X, Y

ROUTE_OR_NOWHERE = 3  # SUMO's word for the nearest place along the route (1), or off the road (2)
NO_LANE_CHANGE = 0
NEAR_M = 20.0  # of its path, on which the ego is looked for: a path may come back beside itself
HANGS_OVER_M = 0.3  # over the edge of its lanes, which no driver has to mind
PASSES_M = 10.0  # from its path; an ego that is farther off passes no stop line and no end of its route


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
        """Takes over the ego as the latest frame has it; raises `EgoFailed`."""

    def drive(self, frame: Frame, belief: Belief, along: Along) -> Motion:
        """Returns the ego's motion after the next step; raises `EgoFailed`."""


class MovedVehicle:
    """Vehicle whose place SUMO is given, such as a pilot's ego.

    Attributes:
      motion: after its latest step.
      lane: of its route, from whose start its path leads.
      along: where it is on its path, that of its first lane along its route, whichever lane it is on.
      inside: whether its body is on lanes that lead along its route. SUMO's drivers see what is on these lanes.
      arrived: whether it reached its route's end. SUMO, which removes its own vehicles there, keeps one that is moved.
      placed: what SUMO would tell of it.
    """

    lane: str
    along: Along
    inside: bool
    arrived: bool
    placed: PlacedState
    _stop_line: PathStopLine | None

    def __init__(self, vehicle: str, motion: Motion, size_m: tuple[float, float], roads: Roads) -> None:
        """Takes over a vehicle; its size is length and width."""
        self._vehicle, self._size_m, self._roads = vehicle, size_m, roads
        self.motion, self._stop_line = motion, None
        libsumo.vehicle.setLaneChangeMode(vehicle, NO_LANE_CHANGE)
        self.lane = libsumo.vehicle.getLaneID(vehicle)
        self._find(roads.along(vehicle).station_m)

    def move(self, motion: Motion) -> None:
        """Has SUMO put it there in its next step."""
        self.motion = motion
        half_m, heading = self._size_m[0] / 2, motion.heading_rad
        x, y = motion.x_m + half_m * math.cos(heading), motion.y_m + half_m * math.sin(heading)
        libsumo.vehicle.moveToXY(self._vehicle, "", -1, x, y, 90.0 - math.degrees(heading), ROUTE_OR_NOWHERE)

    def settle(self) -> None:
        """Finds the vehicle after a step of SUMO, and corrects its speed.

        SUMO derives a speed from the way along the lane, 0 where a lane begins; followers go by it.
        """
        libsumo.vehicle.setPreviousSpeed(self._vehicle, self.motion.speed_mps)
        self._find(self.along.station_m)

    def _find(self, near_m: float) -> None:
        """Finds the vehicle on its path near a station."""
        way, room, _ = self._roads.lane(self._vehicle, self.lane)
        while way.following is not None and near_m >= way.lane_m:  # stations count from the start of the lane
            near_m, self.lane = near_m - way.lane_m, way.following
            if self._stop_line is not None:
                self._stop_line = self._stop_line._replace(station_m=self._stop_line.station_m - way.lane_m)
            way, room, _ = self._roads.lane(self._vehicle, self.lane)
        path, (x, y, heading, speed, accel, _, slip) = way.path, self.motion
        station_m, offset_m, front_x, front_y, lateral, left_m, right_m = _placed(
            path, near_m, x, y, heading, speed, slip, *self._size_m
        )
        self.along = Along(path, station_m, offset_m)
        self.inside = left_m < room.left_m + HANGS_OVER_M and right_m < room.right_m + HANGS_OVER_M
        passes = abs(offset_m) < PASSES_M
        self.arrived = passes and way.complete and station_m >= path[STATION, -1]
        if passes:
            self._stop_line = next((line for line in way.stop_lines if line.station_m >= station_m), None)
        angle = 90.0 - math.degrees(heading)
        self.placed = PlacedState(front_x, front_y, angle, speed, lateral, accel, offset_m, self._ahead(station_m))

    def _ahead(self, station_m: float) -> tuple[str, float] | None:
        if self._stop_line is None:
            return None
        line_m, signal, index = self._stop_line
        letter = libsumo.trafficlight.getRedYellowGreenState(signal)[index]
        return letter, max(line_m - station_m, 0.0)


@compiled
def _placed(
    points: Floats,
    near_m: float,
    x: float,
    y: float,
    heading: float,
    speed: float,
    slip: float,
    length_m: float,
    width_m: float,
) -> tuple[float, float, float, float, float, float, float]:
    """Locates a body on a path near a station.

    Returns:
      Station and offset of the front bumper, its place, the lateral speed, and how far the body reaches to the left and
      to the right of the path.
    """
    near = stretch(points, near_m - NEAR_M, near_m + NEAR_M)
    _, middle_m, lane_heading = project(near, x, y)
    front_x, front_y = x + length_m / 2 * math.cos(heading), y + length_m / 2 * math.sin(heading)
    station_m, offset_m, _ = project(near, front_x, front_y)
    turned = heading - lane_heading
    half_m = abs(math.sin(turned)) * length_m / 2 + abs(math.cos(turned)) * width_m / 2
    lateral = speed * math.sin(turned + slip)
    return station_m, offset_m, front_x, front_y, lateral, half_m + middle_m, half_m - middle_m


REAR_AXLE = 0.8  # Choice: distance of the rear axle from the front bumper over the body's length
OWN_EDGE_M = 0.02  # from the edge of its own lanes, at which SUMO stops taking lateral commands
STRAIGHT_RAD = 0.02  # between heading and direction of motion, up to which SUMO takes over without a jolt


class OncomingVehicle(MovedVehicle):
    """Adversary outside its own lanes, commanded along and across its path.

    SUMO's `changeSublane` cannot take it to oncoming lanes. The middle of its front bumper follows the command, and the
    rear axle follows the front as that of a car does (kinematic bicycle model).
    """

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
        """Finds it after a step of SUMO, with the commanded lateral speed."""
        super().settle()
        self.placed = self.placed._replace(lateral_mps=self._command.lateral_mps)

    def is_back(self, own: LateralRoom) -> bool:
        """Whether its body is straight and within its own lanes' room `own`."""
        turned = self.motion.heading_rad - float(self.along.path[HEADING, segment(self.along)])
        drifts = math.atan2(self._command.lateral_mps, max(self._command.speed_mps, 1e-3))
        straight = abs(math.remainder(turned - drifts, math.tau)) <= STRAIGHT_RAD
        over_m = abs(math.sin(turned)) * self._size_m[0]  # the rear may be farther out than the front
        return straight and min(own) > over_m + OWN_EDGE_M


def driven(motion: Motion, length_m: float, along: Along, command: VehicleCommand) -> Motion:
    """Computes a car's motion after its front bumper's middle follows a command.

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
