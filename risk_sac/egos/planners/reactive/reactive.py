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

from risk_sac.egos.driving import LIMIT, STATION, point_at
from risk_sac.egos.pilot import track
from risk_sac.egos.planners.route import BEFORE_LINE_M, SignalStops, in_view, room_aside_m, way_to_stop_m
from risk_sac.egos.seam import Control, EpisodeStart, Perceived, Trajectory
from risk_sac.sim.pilot import Motion
from risk_sac.world.types import ACCEL, HEADING, LENGTH, SPEED, VX, VY, WIDTH, Floats, X, Y

SPACING_M = 2.0  # of points along the path, which the package's smoothing needs on straights too
BEHIND_M, AHEAD_M = 20.0, 100.0  # by which the path goes on beyond its ends, where the package can project nothing
MARGIN_M = 0.3  # around others; without one, which is the package's default, it drives up to them
SLOWEST_MPS = 0.01  # the package takes 0 for "not given"


class Reactive:
    """Reactive planner: samples in a Frenet frame, keeps the cheapest that collides with no prediction."""

    version = "2025.1"
    response_time_s = 0.5
    deadline_s = 60.0

    def reset(self, episode: EpisodeStart) -> None:
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
        self._signals = SignalStops()
        self._heading: float | None = None

    def act(self, perceived: Perceived) -> Control:
        """Plans each third step and follows the plan; without one it brakes hard."""
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
        return track(plan, motion, self._car)

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
        aside_m = room_aside_m(self._lanes, p, self._car)
        planner.set_d_sampling_parameters(-aside_m, aside_m)
        stop_m = way_to_stop_m(p, self._signals)
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
        except TypeError:  # its log formats a cost that is None, where no sample is feasible just after a hard stop
            found = None
        if found is None:
            return None
        states = found[0].state_list
        time_s = np.arange(len(states), dtype=np.float64) * self._step_s
        places = [(*s.position, s.orientation, s.velocity) for s in states]
        x, y, headings, speeds = np.array(places).T
        return Trajectory(time_s, x + rear_m * np.cos(headings), y + rear_m * np.sin(headings), speeds)

    def _others(self, p: Perceived) -> pycrcc.CollisionChecker:
        """Predicts all others at their velocity, but for vehicles behind in its lane, which react."""
        checker = pycrcc.CollisionChecker()
        for x, y, yaw, vx, vy, length, width in p.state[[X, Y, HEADING, VX, VY, LENGTH, WIDTH]][
            :, in_view(p)
        ].T.tolist():
            body = pycrcc.TimeVariantCollisionObject(0)
            for step in range(self._config.planning.time_steps_computation + 1):
                t = step * self._step_s
                body.append_obstacle(
                    pycrcc.RectOBB(length / 2 + MARGIN_M, width / 2 + MARGIN_M, yaw, x + vx * t, y + vy * t)
                )
            checker.add_collision_object(body)
        return checker
