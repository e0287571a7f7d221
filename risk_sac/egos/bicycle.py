"""How an ego's car moves: a kinematic bicycle that does as much of a command as its limits allow. Pure.

Source: Kong et al. 2015, "Kinematic and dynamic vehicle models for autonomous driving control design", Eq. 1.
"""

import math

from risk_sac.egos.seam import Vehicle
from risk_sac.sim.pilot import Motion


def advance(motion: Motion, accel_mps2: float, steering_rad: float, vehicle: Vehicle, step_s: float) -> Motion:
    """The motion after a step of a command.

    The steering turns no faster than it can, and no further than the grip bears at this speed. What the curve takes of
    the grip is not there to brake or speed up with. A braking builds up at the brakes' jerk; it ends at once.

    Args:
      motion: now.
      accel_mps2: wanted, negative to brake.
      steering_rad: wanted.
      vehicle: with the limits.
      step_s: length of the step.
    """
    v, speed = vehicle, motion.speed_mps
    turn = v.steering_rate_rad_s * step_s
    steering = min(max(steering_rad, motion.steering_rad - turn), motion.steering_rad + turn)
    largest = min(v.steering_rad, math.atan(v.wheelbase_m * v.grip_mps2 / max(speed * speed, 1e-3)))
    steering = min(max(steering, -largest), largest)
    slip = math.atan(math.tan(steering) / 2.0)  # the centre is halfway between the axles
    curvature = 2.0 * math.sin(slip) / v.wheelbase_m
    left_mps2 = math.sqrt(max(v.grip_mps2**2 - (speed * speed * curvature) ** 2, 0.0))
    accel = max(accel_mps2, min(motion.accel_mps2, 0.0) - v.brake_jerk_mps3 * step_s)
    accel = min(max(accel, -min(v.brake_mps2, left_mps2)), min(v.accel_mps2, left_mps2))
    faster = max(speed + accel * step_s, 0.0)
    way_m = (speed + faster) / 2.0 * step_s if faster > 0.0 else _stopping_way(speed, accel)
    turned = curvature * way_m
    chord_m = way_m * _sinc(turned / 2.0)
    direction = motion.heading_rad + slip + turned / 2.0
    return Motion(
        motion.x_m + chord_m * math.cos(direction),
        motion.y_m + chord_m * math.sin(direction),
        motion.heading_rad + turned,
        faster,
        (faster - speed) / step_s,
        steering,
        slip,
    )


def _stopping_way(speed_mps: float, accel_mps2: float) -> float:
    """To a standstill within the step."""
    return speed_mps * speed_mps / (-2.0 * accel_mps2) if accel_mps2 < 0.0 else 0.0


def _sinc(angle: float) -> float:
    return math.sin(angle) / angle if abs(angle) > 1e-9 else 1.0
