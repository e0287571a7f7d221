"""Responsibility-Sensitive Safety distances and margins.

Source: Shalev-Shwartz, Shammah, Shashua 2017, "On a Formal Model of Safe and Scalable Self-driving
Cars", Definitions 1 (same direction), 2 (opposite directions) and 6 (lateral).
"""

from typing import NamedTuple

import numpy as np

from risk_sac.geometry import RelativeView
from risk_sac.jit import compiled
from risk_sac.types import Floats

LONGITUDINAL_CAP_M = 50.0
LATERAL_CAP_M = 5.0


class RssParameters(NamedTuple):
    """What RSS assumes of both parties. The ego is the one that responds."""

    response_s: float = 0.5  # ρ
    accel_mps2: float = 2.6  # a_max,accel during the response time
    brake_min_mps2: float = 4.5  # b_min: what the responding vehicle can be relied on to do
    brake_max_mps2: float = 8.0  # b_max: the hardest braking of the vehicle ahead
    lateral_accel_mps2: float = 0.5
    lateral_brake_mps2: float = 1.0
    fluctuation_m: float = 0.1  # μ, lateral noise that is no manoeuvre


@compiled
def same_direction(rear_mps: float, front_mps: float, parameters: RssParameters) -> float:
    """d_min = [v_r ρ + a ρ²/2 + (v_r + ρ a)² / (2 b_min) − v_f² / (2 b_max)]_+ , m  (Def. 1).

    Args:
      rear_mps: v_r, speed of the vehicle behind.
      front_mps: v_f, speed of the one ahead.
      parameters: see `RssParameters`.
    """
    p = parameters
    after = rear_mps + p.response_s * p.accel_mps2
    distance = (
        (rear_mps + after) * (p.response_s / 2)
        + after * after / (2 * p.brake_min_mps2)
        - front_mps * front_mps / (2 * p.brake_max_mps2)
    )
    return max(distance, 0.0)


@compiled
def opposite_direction(ego_mps: float, other_mps: float, parameters: RssParameters) -> float:
    """d_min: both respond after ρ and brake with b_min; speeds are magnitudes, m  (Def. 2)."""
    p = parameters
    ego_after = ego_mps + p.response_s * p.accel_mps2
    other_after = other_mps + p.response_s * p.accel_mps2
    return (ego_mps + ego_after + other_mps + other_after) * (p.response_s / 2) + (
        ego_after * ego_after + other_after * other_after
    ) / (2 * p.brake_min_mps2)


@compiled
def lateral(closing_ego_mps: float, closing_other_mps: float, parameters: RssParameters) -> float:
    """d_min = μ + [Σ_i (v_i + v_i,ρ) ρ/2 + v_i,ρ² / (2 b_lat)]_+ , m  (Def. 6).

    Args:
      closing_ego_mps: the ego's lateral speed towards the other; negative when it moves away.
      closing_other_mps: the other's towards the ego.
      parameters: see `RssParameters`.
    """
    p = parameters
    total = 0.0
    for closing in (closing_ego_mps, closing_other_mps):
        after = closing + p.response_s * p.lateral_accel_mps2
        total += (closing + after) * (p.response_s / 2) + after * abs(after) / (2 * p.lateral_brake_mps2)
    return p.fluctuation_m + max(total, 0.0)


@compiled
def margins(view: RelativeView, parameters: RssParameters) -> tuple[Floats, Floats]:
    """Longitudinal and lateral RSS margin to each other actor, two arrays `n`, m.

    A margin is the distance between the bodies along one of the ego's axes minus the RSS distance; the
    situation is dangerous where both are negative. An actor alongside has no longitudinal distance.
    """
    n = len(view.x)
    longitudinal, sideways = np.empty(n), np.empty(n)
    ego = max(view.ego_vx, 0.0)
    for i in range(n):
        along, across = view.vx[i] + view.ego_vx, view.vy[i] + view.ego_vy  # the other's velocity in the ego's axes
        if view.x[i] < 0.0:
            distance = same_direction(max(along, 0.0), ego, parameters)
        elif along < 0.0:
            distance = opposite_direction(ego, -along, parameters)
        else:
            distance = same_direction(ego, along, parameters)
        clear = max(abs(view.x[i]) - view.reach[0, i], 0.0)
        longitudinal[i] = min(max(clear - distance, -LONGITUDINAL_CAP_M), LONGITUDINAL_CAP_M)
        side = np.sign(view.y[i])
        distance = lateral(side * view.ego_vy, -side * across, parameters)
        clear = max(abs(view.y[i]) - view.reach[1, i], 0.0)
        sideways[i] = min(max(clear - distance, -LATERAL_CAP_M), LATERAL_CAP_M)
    return longitudinal, sideways
