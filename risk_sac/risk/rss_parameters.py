"""Parameters of `risk_sac.risk.rss`, for modules that load no compiler."""

from typing import NamedTuple


class RssParameters(NamedTuple):
    """Assumptions of RSS about both parties; the ego responds."""

    response_s: float = 0.5  # ρ
    accel_mps2: float = 1.5  # a_max,accel during the response time; a driver that follows or brakes does not accelerate
    brake_min_mps2: float = 6.0  # b_min: what the responding vehicle can be relied on to do
    brake_max_mps2: float = 6.0  # b_max: the hardest braking of the vehicle ahead that is to be expected
    lateral_accel_mps2: float = 0.5
    lateral_brake_mps2: float = 2.0
    fluctuation_m: float = 0.1  # μ, lateral noise that is no manoeuvre
    walk_accel_mps2: float = 0.5  # a pedestrian's, in any direction
    walk_brake_mps2: float = 2.0
