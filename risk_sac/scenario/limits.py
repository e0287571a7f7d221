"""Kinematic limits of the adversaries, as the ODD and the road surface allow."""

from dataclasses import dataclass

from risk_sac.config import Odd

GRAVITY_MPS2 = 9.81


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds that hold at every step; all positive."""

    # vehicles
    speed_mps: float
    accel_mps2: float
    brake_mps2: float
    jerk_mps3: float = 20.0  # an emergency braking builds up in about 0.4 s
    lateral_mps: float = 2.0  # a brisk lane change takes about 2 s
    lateral_accel_mps2: float = 4.0
    slip: float = 0.2  # lateral over longitudinal speed: about 11 degrees against the lane
    # pedestrians
    walk_speed_mps: float
    walk_accel_mps2: float
    walk_brake_mps2: float
    heading_rate_radps: float = 1.5


def limits_from_odd(odd: Odd, friction: float) -> Limits:
    """The ODD's bounds, with vehicle acceleration further bounded by friction · g.

    Args:
      odd: complete, as a family's default or an intersection with it.
      friction: of this scene's road surface.
    """
    dynamic = odd.dynamic
    if not (
        dynamic.vehicle_speed_mps
        and dynamic.vehicle_accel_mps2
        and dynamic.pedestrian_speed_mps
        and dynamic.pedestrian_accel_mps2
    ):
        raise ValueError("the ODD is incomplete; intersect it with a family's default first")
    grip = friction * GRAVITY_MPS2
    return Limits(
        speed_mps=dynamic.vehicle_speed_mps.high,
        accel_mps2=min(dynamic.vehicle_accel_mps2.high, grip),
        brake_mps2=min(-dynamic.vehicle_accel_mps2.low, grip),
        walk_speed_mps=dynamic.pedestrian_speed_mps.high,
        walk_accel_mps2=dynamic.pedestrian_accel_mps2.high,
        walk_brake_mps2=-dynamic.pedestrian_accel_mps2.low,
    )
