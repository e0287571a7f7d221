"""Moves and steers an ego's car, a kinematic bicycle with limits.

Source: Kong et al. 2015, "Kinematic and dynamic vehicle models for autonomous driving control design", Eq. 1.
"""

import math
from functools import cache
from itertools import compress

import numpy as np

from risk_sac.config import EgoConfig
from risk_sac.egos.driving import LEAST_LOOKAHEAD_M, steering_towards
from risk_sac.egos.equipment import Actuation, Sensing, limited
from risk_sac.egos.guard import Guarded
from risk_sac.egos.seam import Control, EpisodeStart, Perceived, Trajectory, Vehicle
from risk_sac.scenario.layout import Layout
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.sim.ego import Belief
from risk_sac.sim.paths import Along
from risk_sac.sim.pilot import Motion
from risk_sac.sim.roads import road_around, signals_at
from risk_sac.world.jit import compiled
from risk_sac.world.types import (
    ACCEL,
    HEADING,
    LATERAL,
    OFFSET,
    SPEED,
    STEP_S,
    VX,
    VY,
    Bools,
    Floats,
    Frame,
    Road,
    Signal,
    X,
    Y,
)


def advance(motion: Motion, accel_mps2: float, steering_rad: float, vehicle: Vehicle, step_s: float) -> Motion:
    """Returns the motion after a step of a command.

    The steering turns no faster than it can, and no further than the grip bears at this speed. What the curve takes of
    the grip is not there to brake or speed up with. A braking builds up at the brakes' jerk; it ends at once.
    """
    v = vehicle
    limits = (v.accel_mps2, v.brake_mps2, v.brake_jerk_mps3, v.steering_rad, v.steering_rate_rad_s, v.grip_mps2)
    return Motion(*_advanced(tuple(motion), (float(accel_mps2), float(steering_rad)), v.wheelbase_m, limits, step_s))


@compiled
def _advanced(
    motion: tuple[float, ...],
    command: tuple[float, float],
    wheelbase_m: float,
    limits: tuple[float, float, float, float, float, float],
    step_s: float,
) -> tuple[float, float, float, float, float, float, float]:
    x_m, y_m, heading_rad, speed, before_mps2, steered_rad, _ = motion
    wanted_mps2, wanted_rad = command
    most_accel_mps2, most_brake_mps2, brake_jerk_mps3, most_steering_rad, steering_rate_rad_s, grip_mps2 = limits
    turn = steering_rate_rad_s * step_s
    steering = min(max(wanted_rad, steered_rad - turn), steered_rad + turn)
    largest = min(most_steering_rad, math.atan(wheelbase_m * grip_mps2 / max(speed * speed, 1e-3)))
    steering = min(max(steering, -largest), largest)
    slip = math.atan(math.tan(steering) / 2.0)  # the centre is halfway between the axles
    curvature = 2.0 * math.sin(slip) / wheelbase_m
    left_mps2 = math.sqrt(max(grip_mps2**2 - (speed * speed * curvature) ** 2, 0.0))
    accel = max(wanted_mps2, min(before_mps2, 0.0) - brake_jerk_mps3 * step_s)
    accel = min(max(accel, -min(most_brake_mps2, left_mps2)), min(most_accel_mps2, left_mps2))
    faster = max(speed + accel * step_s, 0.0)
    way_m = (speed + faster) / 2.0 * step_s
    if faster == 0.0:  # to a standstill within the step
        way_m = speed * speed / (-2.0 * accel) if accel < 0.0 else 0.0
    turned = curvature * way_m
    chord_m = way_m * (math.sin(turned / 2.0) / (turned / 2.0) if abs(turned / 2.0) > 1e-9 else 1.0)
    direction = heading_rad + slip + turned / 2.0
    return (
        x_m + chord_m * math.cos(direction),
        y_m + chord_m * math.sin(direction),
        heading_rad + turned,
        faster,
        (faster - speed) / step_s,
        steering,
        slip,
    )


AHEAD_S = 0.5  # time from now of the place that steering aims at
FOLLOW_S = 0.2  # time within which the car reaches its plan's speed


def track(trajectory: Trajectory, motion: Motion, vehicle: Vehicle) -> Control:
    """Returns the control that follows a valid trajectory.

    Choice: it aims at the place of `AHEAD_S` from now, but no nearer than `LEAST_LOOKAHEAD_M` where the trajectory goes
    so far, else straight on: nearer aims make a slow car turn its wheels to and fro. It takes on the
    speed of `FOLLOW_S` from now: with `AHEAD_S` it braked too late for stop lines.
    """
    t = trajectory
    speed = float(np.interp(FOLLOW_S, t.time_s, t.speed_mps))
    accel = (speed - motion.speed_mps) / FOLLOW_S
    away_m = np.hypot(t.x_m - motion.x_m, t.y_m - motion.y_m)
    far = np.flatnonzero((t.time_s >= AHEAD_S) & (away_m >= LEAST_LOOKAHEAD_M))
    if not len(far):
        return Control(accel, 0.0)
    aim = float(t.x_m[far[0]]), float(t.y_m[far[0]])
    steering = steering_towards(motion.x_m, motion.y_m, motion.heading_rad, vehicle.wheelbase_m, *aim)
    return Control(accel, float(steering))


BRAKE_MPS2 = 9.0  # hardest braking, that of SUMO's driver on dry asphalt


def perceive(frame: Frame, belief: Belief, along: Along, signals: tuple[Signal, ...]) -> Perceived:
    """Returns the frame's actors that the ego senses or remembers."""
    known = belief.known
    path, station_m, offset_m, _ = along
    return Perceived(
        time_s=frame.time_s,
        ids=tuple(compress(frame.ids, known.tolist())),
        kind=frame.kind[known],
        state=shown(belief.state, known),
        path=path,
        station_m=station_m,
        offset_m=offset_m,
        signal=frame.signal,
        stop_line_m=frame.stop_line_m,
        signals=signals,
    )


class EgoPilot:
    """Drives the ego of one episode after the other.

    Attributes:
      vehicle: the car of the episode and its limits.
      commanded: the latest command, before the actuators.
    """

    vehicle: Vehicle
    commanded: Control
    _motion: Motion
    _road: Road

    def __init__(self, ego: Guarded, config: EgoConfig) -> None:
        self._ego = ego
        errors, self._actuators = config.sensor_errors, config.actuator_config
        self._sensing = None if errors is None else Sensing(errors)
        self._actuation = None if self._actuators is None else Actuation(self._actuators)
        self._net, self._set_speed_mps, self._road_around = "", math.inf, cache(road_around)

    def begin(self, layout: Layout, seed: int, frame: Frame) -> Motion:
        """See `risk_sac.sim.pilot.Pilot.begin`."""
        grip = layout.friction * GRAVITY_MPS2
        length_m, width_m = float(frame.length_m[0]), float(frame.width_m[0])
        vehicle = Vehicle(length_m=length_m, width_m=width_m, brake_mps2=min(BRAKE_MPS2, grip), grip_mps2=grip)
        self.vehicle = limited(vehicle, self._actuators)
        own = frame.state[[X, Y, HEADING, SPEED, ACCEL], 0].tolist()
        self._motion = Motion(*own)
        if self._sensing is not None:
            self._sensing.begin(seed, STEP_S)
        if self._actuation is not None:
            self._actuation.begin(self._motion.accel_mps2, self._motion.steering_rad, STEP_S)
        if (layout.net, layout.set_speed_mps) != (self._net, self._set_speed_mps):  # of the same names, or other limits
            self._net, self._set_speed_mps = layout.net, layout.set_speed_mps
            self._road_around.cache_clear()
        route = layout.ego.route
        self._road = self._road_around(route)
        self._ego.reset(
            EpisodeStart(seed=seed, net=layout.net, route=route, vehicle=self.vehicle, step_s=STEP_S, road=self._road)
        )
        return self._motion

    def drive(self, frame: Frame, belief: Belief, along: Along) -> Motion:
        """See `risk_sac.sim.pilot.Pilot.drive`."""
        perceived = perceive(frame, belief, along, signals_at(self._road.stop_lines))
        command = self._ego.act(perceived if self._sensing is None else self._sensing.perceive(perceived))
        if isinstance(command, Trajectory):
            command = track(command, self._motion, self.vehicle)
        self.commanded = command
        if self._actuation is not None:
            command = self._actuation.act(command)
        self._motion = advance(self._motion, command.accel_mps2, command.steering_rad, self.vehicle, STEP_S)
        return self._motion

    @property
    def took_s(self) -> float:
        """Real time that the latest command took, s."""
        return self._ego.took_s

    @property
    def defect_reached_s(self) -> float | None:
        """See `Planted.reached_s`, of an ego that has defects."""
        return self._ego.defect_reached_s

    def close(self) -> None:
        """Closes the ego."""
        self._ego.close()


@compiled
def shown(state: Floats, known: Bools) -> Floats:
    """Returns known actors' columns with the rows that a sensor measures."""
    measured = np.empty((state.shape[0], int(known.sum())))
    column = 0
    for i in range(state.shape[1]):
        if not known[i]:
            continue
        for row in range(state.shape[0]):
            measured[row, column] = state[row, i]
        if i > 0:
            measured[SPEED, column] = math.hypot(state[VX, i], state[VY, i])
            measured[LATERAL, column] = measured[ACCEL, column] = measured[OFFSET, column] = np.nan
        column += 1
    return measured
