"""Frenet planners of the package `fiss-planner`, run as its documentation does.

Source: Sun et al. 2022, "FISS: A Trajectory Planning Framework Using Fast Iterative Search and Sampling Strategy for
Autonomous Driving"; Sun et al. 2023, "FISS+"; for FOP Werling et al. 2010. Settings are the package's own, where no
comment says otherwise. From its adapters come the numbers below.
"""

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import fiss_planner as fp
import numpy as np

from risk_sac.egos.driving import lane_edges
from risk_sac.egos.pilot import track
from risk_sac.egos.planners.route import SignalStops, in_pieces, lanes_ahead, stops
from risk_sac.egos.seam import Control, EpisodeStart, Perceived, Trajectory, Vehicle
from risk_sac.sim.pilot import Motion
from risk_sac.world.types import ACCEL, HEADING, LENGTH, SPEED, VX, VY, WIDTH, Kind, Road, X, Y

SPACING_M = 2.0  # distance between points along lanes
PIECE_M = 50.0  # length of a piece of a lane; the planner's step takes as long as the lanes near it are
GROWN_M = 0.2  # margin added to the length and width of other actors
MOVING_MPS = 0.5  # speed from which the velocity gives an actor's heading
MOST_BRAKING_MPS2 = 8.0  # hardest braking of a plan; in an emergency the car brakes as hard as it can
BEYOND_M = 20.0  # length of the lanes known to the planner beyond its longest plan; more only costs time
BEYOND_S = 0.5  # time that predictions reach beyond the longest plan


class FrenetPlanner:
    """The package's local planner on the seam's road; the car follows plans.

    The seam's tracker follows them. The package's own MPC does not know the wheels' angle. In three staged starts,
    which are too few to tell them apart, that went up to 1.4 m beyond a plan's widest point, the tracker up to 0.4 m.
    """

    kind: ClassVar[str]
    _told: Road | None = None

    def reset(self, episode: EpisodeStart) -> None:
        """Begins an episode; raises a ValueError for one without a road."""
        if not episode.road.lanes:
            raise ValueError("the episode has no road, without which this planner cannot plan")
        if episode.road is not self._told:  # the same object on the same road, within a process
            self._told, self._road = episode.road, in_pieces(episode.road, PIECE_M, SPACING_M)
            self._numbers = {lane.id: number for number, lane in enumerate(self._road.lanes)}
            self._map = road_map(self._road, self._numbers)
        self._step_s, self._car = episode.step_s, episode.vehicle
        self._planner: Any = None
        self._signals = SignalStops()
        self._ids: dict[str, int] = {}
        self._heading: float | None = None

    def act(self, perceived: Perceived) -> Control:
        """Plans, and follows the plan."""
        ego = self._ego(perceived)
        if self._planner is None:
            self._start(ego)
        for number, active in enumerate(stops(self._road, perceived, self._signals)):
            self._planner.set_stop_line_active(number, active)
        plan = self._planner.step(perceived.time_s, ego, self._obstacles(perceived))
        if len(plan.trajectory) < 2:
            return Control(-self._car.brake_mps2)
        t = plan.trajectory
        planned = Trajectory(*(np.asarray(row) for row in (t.t, t.x, t.y, t.v)))
        control = track(planned, Motion(ego.x, ego.y, ego.yaw, ego.v, ego.a), self._car)
        return control._replace(accel_mps2=-self._car.brake_mps2) if plan.emergency else control

    def close(self) -> None:
        """Releases nothing."""

    def _start(self, ego: Any) -> None:
        config = fp.LocalPlannerConfig()
        config.planner.type = fp.planner_type_from_string(self.kind)
        config.desired_speed = max(lane.limit_mps for lane in self._road.lanes)  # so that each lane's limit decides
        config.emergency_decel = self._car.brake_mps2
        config.planner.collision.ignore_rear_in_lane = True  # as it drives in CARLA: those behind react
        self._reach_s = config.planner.sampling.max_t + BEYOND_S
        way_m = config.desired_speed * config.planner.sampling.max_t + BEYOND_M
        config.route.lookahead = min(config.route.lookahead, way_m)
        self._planner = fp.LocalPlanner(config, vehicle_params(self._car))
        start = self._map.locate(ego.x, ego.y, ego.yaw)
        if start < 0:
            raise ValueError(f"the ego begins on no lane of its road: at {ego.x:.1f}, {ego.y:.1f}")
        way = lanes_ahead(self._road, self._road.lanes[start].id)
        self._planner.set_map(self._map, [self._numbers[id_] for id_ in way])

    def _ego(self, perceived: Perceived) -> Any:
        x_m, y_m, heading, speed, accel = perceived.state[[X, Y, HEADING, SPEED, ACCEL], 0].tolist()
        turned = 0.0 if self._heading is None else math.remainder(heading - self._heading, math.tau)
        self._heading = heading
        curvature = turned / (speed * self._step_s) if speed > 1.0 else 0.0
        return fp.EgoState(x_m, y_m, heading, speed, accel, curvature)

    def _obstacles(self, perceived: Perceived) -> list[Any]:
        """Predicts vehicles along their lanes, and all else at its velocity."""
        rows = perceived.state[[X, Y, HEADING, VX, VY, LENGTH, WIDTH], 1:].T.tolist()
        obstacles = []
        for id_, kind, (x, y, heading, vx, vy, length, width) in zip(
            perceived.ids[1:], perceived.kind[1:].tolist(), rows, strict=True
        ):
            speed = math.hypot(vx, vy)
            yaw = math.atan2(vy, vx) if speed > MOVING_MPS else heading
            number = self._ids.setdefault(id_, len(self._ids))
            told = (number, x, y, yaw, speed, length + GROWN_M, width + GROWN_M, self._reach_s, self._step_s)
            if kind == Kind.VEHICLE:
                obstacles.append(fp.predict_lane_following(self._map, *told))
            else:
                obstacles.append(fp.predict_constant_velocity(*told))
        return obstacles


def road_map(road: Road, numbers: Mapping[str, int]) -> Any:
    """Returns the package's map of a road: numbered lanes and stop lines."""
    planner_map = fp.RoadMap()
    for road_lane in road.lanes:
        lane, (left, right) = fp.MapLane(), lane_edges(road_lane)
        lane.id, lane.speed_limit = numbers[road_lane.id], road_lane.limit_mps
        lane.centerline, lane.left, lane.right = (
            np.ascontiguousarray(line.T) for line in (road_lane.line, left, right)
        )
        if road_lane.left:
            lane.left_neighbor, lane.can_change_left = numbers[road_lane.left], road_lane.may_change_left
        if road_lane.right:
            lane.right_neighbor, lane.can_change_right = numbers[road_lane.right], road_lane.may_change_right
        lane.successors = [numbers[id_] for id_ in road_lane.successors]
        planner_map.add_lane(lane)
    for number, line in enumerate(road.stop_lines):
        lane = planner_map.lane(numbers[line.lane])
        planner_map.add_stop_line(fp.StopLine(number, lane.id, lane.length(), False))
    planner_map.finalize()
    return planner_map


def vehicle_params(car: Vehicle) -> Any:
    """Returns the car's parameters for the package, which sets other limits."""
    params = fp.VehicleParams()
    params.length, params.width, params.wheelbase = car.length_m, car.width_m, car.wheelbase_m
    params.rear_axle_to_center = car.wheelbase_m / 2
    params.max_accel, params.max_decel = car.accel_mps2, min(car.brake_mps2, MOST_BRAKING_MPS2)
    params.max_steer, params.max_steer_rate = car.steering_rad, car.steering_rate_rad_s
    return params


class Fop(FrenetPlanner):
    """Frenet optimal planner: keeps the cheapest valid candidate (fiss-planner 1.0.0)."""

    version = "1.0.0"
    response_time_s = 0.5
    kind = "fop_plus"  # chooses as `fop` does, but validates in order of cost, which is faster


class Fiss(FrenetPlanner):
    """FISS: searches end states iteratively from the previous plan (fiss-planner 1.0.0)."""

    version = "1.0.0"
    response_time_s = 0.5
    kind = "fiss"


class FissPlus(FrenetPlanner):
    """FISS+: explores the best end states first, and refines them (fiss-planner 1.0.0)."""

    version = "1.0.0"
    response_time_s = 0.5
    kind = "fiss_plus"
