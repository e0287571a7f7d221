"""How much grip a vehicle's motion took: what it drove, not what it was told.

Accelerations come from quadratics fitted to a second of the front bumper's positions. The front follows its lane, whose
polyline has kinks, and a lateral move starts and stops within a step; a second is what a real vehicle needs to yaw.
"""

from functools import cache

import numpy as np

from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.types import Floats, Kind
from risk_sac.verdicts.evidence import Evidence

LOOKS_BACK_S = 2.0
WINDOW_S = 1.0
TOLERANCE = 1.05
LEAST_POINTS = 5


def inside_grip(evidence: Evidence, striker: int) -> bool:
    """Whether the striker's driving of the last 2 s fits into the road's friction circle: |a| ≤ 1.05 μ g.

    |a| covers braking, lane changes and cornering alike. Pedestrians pass.
    """
    if evidence.kind[striker] == Kind.PEDESTRIAN:
        return True
    used = used_grip(evidence, striker)
    return bool(used.max(initial=0.0) <= TOLERANCE * evidence.ground.friction * GRAVITY_MPS2)


def used_grip(evidence: Evidence, striker: int) -> Floats:
    """|a| of the striker at the middle of each second within the last 2 s, m/s²; empty with less than 0.5 s on record.

    x(t) ≈ x0 + v t + a t²/2 by least squares, and y alike; |a| = √(a_x² + a_y²).
    """
    e = evidence
    heading = e.heading_rad[:, striker]
    reach = e.length_m[striker] / 2
    front = np.stack((e.x_m[:, striker] + reach * np.cos(heading), e.y_m[:, striker] + reach * np.sin(heading)))
    first = e.since(LOOKS_BACK_S + WINDOW_S / 2)
    points = min(round(WINDOW_S / e.step_s) + 1, front.shape[1] - first)
    if points < LEAST_POINTS:
        return np.empty(0)
    windows = np.lib.stride_tricks.sliding_window_view(front[:, first:], points, axis=1)
    accel = 2 * windows @ _curvature(points, e.step_s)  # 2 x windows
    size: Floats = np.hypot(accel[0], accel[1])
    return size


@cache
def _curvature(points: int, step_s: float) -> Floats:
    """Weights that take `points` samples to the coefficient of t² of their least-squares quadratic."""
    t = (np.arange(points) - (points - 1) / 2) * step_s
    weights: Floats = np.linalg.pinv(np.stack((np.ones(points), t, t * t), axis=1))[2]
    return weights
