"""CommonRoad's reactive planner as an ego, which runs in a process and an environment of its own.

Source: Werling et al. 2010, 2012; package `commonroad-reactive-planner`. Settings are the package's own, where no
comment says otherwise.
"""

import math

import commonroad_dc.pycrcc as pycrcc
import numpy as np
from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad_rp.reactive_planner import ReactivePlanner
from commonroad_rp.state import ReactivePlannerState
from commonroad_rp.utility.config import ReactivePlannerConfiguration
from commonroad_rp.utility.utils_coordinate_system import create_coordinate_system

from risk_sac.egos.bicycle import track
from risk_sac.egos.road import LIMIT, STATION, point_at
from risk_sac.egos.seam import Control, Episode, Perceived, Trajectory
from risk_sac.sim.pilot import Motion
from risk_sac.types import ACCEL, HEADING, LENGTH, SPEED, VX, VY, WIDTH, Floats, Kind, Signal, X, Y

LAST_STOP_MPS2 = 4.5  # by which it still stops at yellow
BEGINS_MPS2 = 2.5  # braking at which it begins to stop at a line
BEFORE_LINE_M = 1.0  # where it stops
SPACING_M = 2.0  # of points along the path, which the package's smoothing needs on straights too
BEHIND_M, AHEAD_M = 20.0, 100.0  # by which the path goes on beyond its ends, where the package can project nothing
MARGIN_M = 0.3  # around others; without one, which is the package's default, it drives up to them
BESIDE_M = 0.1  # between its body and the lane's edge
SLOWEST_MPS = 0.01  # the package takes 0 for "not given"
FOLLOW_S = 0.2  # within which the car reaches its plan's speed


class Reactive:
    """Reactive planner: samples in a Frenet frame, keeps the cheapest that collides with no prediction."""

    version = "2025.1"
    response_time_s = 0.5
    deadline_s = 60.0

    def reset(self, episode: Episode) -> None:
        """Begins an episode."""
        config = ReactivePlannerConfiguration()
        car, half_m = episode.vehicle, episode.vehicle.wheelbase_m / 2
        vehicle, most_rad_s = config.vehicle, car.steering_rate_rad_s
        vehicle.length, vehicle.width = car.length_m, car.width_m
        vehicle.wb_front_axle, vehicle.wb_rear_axle = half_m, half_m
        vehicle.a_max, vehicle.delta_max, vehicle.v_delta_max = car.brake_mps2, car.steering_rad, most_rad_s
        vehicle.delta_min, vehicle.v_delta_min = -car.steering_rad, -most_rad_s
        vehicle._update_computed_params()
        config.planning.dt = episode.step_s
        config.debug.multiproc, config.debug.logging_level = False, "ERROR"
        config.scenario = Scenario(episode.step_s, ScenarioID())  # empty: its lane is in the bounds of the samples
        self._config, self._car, self._lanes, self._step_s = config, car, episode.road.lanes, episode.step_s
        self._planner = ReactivePlanner(config)
        self._path: Floats | None = None
        self._plan: Trajectory | None = None
        self._age = 0  # steps of the plan
        self._heading: float | None = None

    def act(self, perceived: Perceived) -> Control:
        """Plans each third step, as the package does, and follows the plan; without one it brakes as hard as it can."""
        ego = perceived.state[:, 0]
        turned = 0.0 if self._heading is None else math.remainder(ego[HEADING] - self._heading, math.tau)
        self._heading = float(ego[HEADING])
        if self._plan is None or self._age >= self._config.planning.replanning_frequency:
            self._plan, self._age = self._planned(perceived, turned / self._step_s), 0
        self._age += 1
        if self._plan is None:
            return Control(-self._car.brake_mps2)
        plan = self._plan._replace(time_s=self._plan.time_s - (self._age - 1) * self._step_s)
        motion = Motion(*(float(ego[row]) for row in (X, Y, HEADING, SPEED, ACCEL)))
        speed = float(np.interp(FOLLOW_S, plan.time_s, plan.speed_mps))
        return Control((speed - motion.speed_mps) / FOLLOW_S, track(plan, motion, self._car).steering_rad)

    def close(self) -> None:
        """Releases nothing."""

    def _planned(self, p: Perceived, yaw_rate: float) -> Trajectory | None:
        """Plans from where the ego is; None if no sample is feasible and free."""
        planner = self._planner
        if p.path is not self._path:
            self._path = p.path
            stations = np.arange(-BEHIND_M, p.path[STATION, -1] + AHEAD_M, SPACING_M)
            line = np.array([point_at(p.path, station_m) for station_m in stations])
            planner.set_reference_path(coordinate_system=create_coordinate_system(line))
        x_m, y_m, heading, speed, accel = p.state[[X, Y, HEADING, SPEED, ACCEL], 0].tolist()
        rear_m, speed = self._config.vehicle.wb_rear_axle, max(speed, SLOWEST_MPS)
        state = ReactivePlannerState(
            time_step=0,
            position=np.array([x_m - rear_m * math.cos(heading), y_m - rear_m * math.sin(heading)]),
            orientation=heading,
            velocity=speed,
            acceleration=accel,
            yaw_rate=yaw_rate,
            steering_angle=math.atan(self._car.wheelbase_m * yaw_rate / speed) if speed > 1.0 else 0.0,
        )
        planner._low_vel_mode = speed < self._config.planning.low_vel_mode_threshold
        planner.reset(initial_state_cart=state, collision_checker=self._others(p))
        aside_m = self._aside_m(p)
        planner.set_d_sampling_parameters(-aside_m, aside_m)
        stop_m = self._stop_m(p)
        if stop_m is None:
            self._config.sampling.longitudinal_mode = "velocity_keeping"
            limit = p.path[LIMIT, np.searchsorted(p.path[STATION], p.station_m, side="right") - 1]
            planner.set_desired_velocity(desired_velocity=float(limit), current_speed=speed)
        elif stop_m <= 0.0:
            return None
        else:
            self._config.sampling.longitudinal_mode = "stopping"
            planner.set_desired_lon_position(planner.x_0_cl[0][0] + stop_m, -min(stop_m, 1.0) / 2, BEFORE_LINE_M / 2)
        try:
            found = planner.plan()
        except TypeError:  # its log formats a cost that is None, where it stands and no sample is feasible
            found = None
        if found is None:
            return None
        states = found[0].state_list
        time_s = np.arange(len(states), dtype=np.float64) * self._step_s
        places = [(*s.position, s.orientation, s.velocity) for s in states]
        x, y, headings, speeds = np.array(places).T
        return Trajectory(time_s, x + rear_m * np.cos(headings), y + rear_m * np.sin(headings), speeds)

    def _stop_m(self, p: Perceived) -> float | None:
        """Returns the way to where a signal makes it stop; None if none does."""
        speed, left_m = float(p.state[SPEED, 0]), p.stop_line_m
        late = p.signal is Signal.YELLOW and speed * speed > 2.0 * LAST_STOP_MPS2 * left_m
        if p.signal not in (Signal.YELLOW, Signal.RED) or late:
            return None
        way_m = left_m - BEFORE_LINE_M
        return way_m if way_m < speed * speed / (2.0 * BEGINS_MPS2) + speed + 5.0 else None

    def _aside_m(self, p: Perceived) -> float:
        """Returns how far from the path a sample may end in the lane that the ego is on."""
        x_m, y_m = p.state[[X, Y], 0]
        own = min(self._lanes, key=lambda lane: np.hypot(lane.line[0] - x_m, lane.line[1] - y_m).min())
        return max(own.width_m / 2 - self._car.width_m / 2 - BESIDE_M, BESIDE_M)

    def _others(self, p: Perceived) -> pycrcc.CollisionChecker:
        """Predicts all others at their velocity, but for vehicles behind in its lane, which react."""
        checker = pycrcc.CollisionChecker()
        x_m, y_m, heading, length_m = p.state[[X, Y, HEADING, LENGTH], 0].tolist()
        rows = p.state[[X, Y, HEADING, VX, VY, LENGTH, WIDTH], 1:].T.tolist()
        for kind, (x, y, yaw, vx, vy, length, width) in zip(p.kind[1:].tolist(), rows, strict=True):
            along_m = (x - x_m) * math.cos(heading) + (y - y_m) * math.sin(heading)
            across_m = (y - y_m) * math.cos(heading) - (x - x_m) * math.sin(heading)
            if kind == Kind.VEHICLE and along_m < -length_m / 2 and abs(across_m) < self._car.width_m:
                continue
            body = pycrcc.TimeVariantCollisionObject(0)
            for step in range(self._config.planning.time_steps_computation + 1):
                t = step * self._step_s
                body.append_obstacle(
                    pycrcc.RectOBB(length / 2 + MARGIN_M, width / 2 + MARGIN_M, yaw, x + vx * t, y + vy * t)
                )
            checker.add_collision_object(body)
        return checker
