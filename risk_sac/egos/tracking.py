"""What a car does for a trajectory: it steers to where it is to be a little later, at the speed of then. Pure."""

import numpy as np

from risk_sac.egos.road import LEAST_LOOKAHEAD_M, steering_towards
from risk_sac.egos.seam import Control, Trajectory, Vehicle
from risk_sac.sim.pilot import Motion

AHEAD_S = 0.5


def track(trajectory: Trajectory, motion: Motion, vehicle: Vehicle) -> Control:
    """The control that follows a trajectory.

    Choice: it aims at the place of `AHEAD_S` from now, but no nearer than `LEAST_LOOKAHEAD_M` where the trajectory goes
    so far, else straight on: nearer aims make a slow car turn its wheels to and fro.

    Args:
      trajectory: valid, see `risk_sac.egos.guard`.
      motion: of the car now.
      vehicle: with the wheelbase.
    """
    t = trajectory
    speed = float(np.interp(AHEAD_S, t.time_s, t.speed_mps))
    accel = (speed - motion.speed_mps) / AHEAD_S
    away_m = np.hypot(t.x_m - motion.x_m, t.y_m - motion.y_m)
    far = np.flatnonzero((t.time_s >= AHEAD_S) & (away_m >= LEAST_LOOKAHEAD_M))
    if not len(far):
        return Control(accel, 0.0)
    aim = float(t.x_m[far[0]]), float(t.y_m[far[0]])
    steering = steering_towards(motion.x_m, motion.y_m, motion.heading_rad, vehicle.wheelbase_m, *aim)
    return Control(accel, float(steering))
