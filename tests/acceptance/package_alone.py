"""Three failures of the package `fiss-planner`, used alone with its defaults.

    python tests/acceptance/package_alone.py

prints for each planner where the ego is 5 s after a light has turned red, how fast it hits a leader that brakes, and
whether a car that cuts in hits it, predicted along its lane and at its velocity.
"""

import math

import fiss_planner as fp
import numpy as np


def planner(kind, lanes=1, line_m=None, limit=13.9):
    x = np.arange(0.0, 401.0, 2.0)
    road = fp.RoadMap()
    for k in range(lanes):
        lane = fp.MapLane()
        lane.id, lane.speed_limit = k, limit
        y = 3.3 * k
        lane.centerline, lane.left, lane.right = (
            np.column_stack((x, np.full_like(x, y + d))) for d in (0.0, 1.65, -1.65)
        )
        road.add_lane(lane)
    if line_m:
        road.add_stop_line(fp.StopLine(0, 0, line_m, False))
    road.finalize()
    config = fp.LocalPlannerConfig()
    config.planner.type = fp.planner_type_from_string(kind)
    config.planner.collision.ignore_rear_in_lane = True  # as its drive in CARLA
    config.desired_speed = limit
    found = fp.LocalPlanner(config)
    found.set_map(road, [0])
    return found, road


def turns_red(kind):
    """A light turns red 29.8 m ahead at 13.8 m/s."""
    plans, _ = planner(kind, line_m=200.0)
    ego = fp.EgoState(140.35, 0.0, 0.0, 13.8, 0.0, 0.0)
    for t in np.arange(0.0, 5.0, 0.1):
        plans.set_stop_line_active(0, bool(t > 1.95))
        ego = plans.step(t, ego, []).trajectory.sample(0.1)
    return ego.x, ego.v


def leader_brakes(kind):
    """A leader 20 m ahead brakes by 6 m/s² from 16 m/s."""
    plans, road = planner(kind, limit=16.67)
    ego, x, v = fp.EgoState(50.0, 0.0, 0.0, 15.0, 0.0, 0.0), 74.5, 16.0
    for t in np.arange(0.0, 6.0, 0.1):
        leader = fp.predict_lane_following(road, 1, x, 0.0, 0.0, v, 4.5, 1.8, 5.5, 0.1)
        plan = plans.step(t, ego, [leader]).trajectory
        ego = plan.sample(0.1) if len(plan) > 1 else ego
        after = max(v - 0.6, 0.0)
        x, v = x + (v + after) / 20, after
        if x - ego.x < 4.5:
            return ego.v - v
    return 0.0


def cuts_in(kind, predict):
    """A car 4 m ahead in the next lane drifts over slowly."""
    plans, road = planner(kind, lanes=2)
    ego, x, y, v, aside = fp.EgoState(50.0, 0.0, 0.0, 13.5, 0.0, 0.0), 54.0, 3.3, 13.0, -0.8
    for t in np.arange(0.0, 5.0, 0.1):
        state = x, y, math.atan2(aside, v), math.hypot(v, aside), 4.5, 1.8, 5.5, 0.1
        car = (
            fp.predict_lane_following(road, 1, *state) if predict == "lane" else fp.predict_constant_velocity(1, *state)
        )
        plan = plans.step(t, ego, [car]).trajectory
        ego = plan.sample(0.1) if len(plan) > 1 else ego
        x, y = x + v / 10, y + aside / 10
        if abs(x - ego.x) < 4.5 and abs(y - ego.y) < 1.8:
            return True
    return False


def main() -> None:
    for kind in ("fiss_plus", "fiss", "fop_plus"):
        print(kind, turns_red(kind), leader_brakes(kind), cuts_in(kind, "lane"), cuts_in(kind, "velocity"))


if __name__ == "__main__":
    main()
