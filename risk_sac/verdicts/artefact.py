"""The rules by which a contact is an artefact of the simulator or the control."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.types import Floats, Kind
from risk_sac.verdicts.conflict import Conflict
from risk_sac.verdicts.evidence import Evidence

AFTER_RELEASE_S = 1.0
GRIP_LOOKS_BACK_S = 2.0
GRIP_WINDOW_S = 1.0
GRIP_TOLERANCE = 1.05
LEAST_POINTS = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Handling:
    """What the simulator and the control did until the contact."""

    teleported: bool
    spawn_overlap: bool
    inside_limits: bool  # every adversary, up to the contact
    touched_before: bool  # the striking actor's body overlapped another one earlier
    ego_model_saw: bool  # SUMO's own boxes had the striker where ours had it


def artefact_verdicts(evidence: Evidence, striker: int, conflict: Conflict, handling: Handling) -> Mapping[str, bool]:
    """The rules of `ARTEFACT_RULES`, each with whether the contact passes it."""
    return {
        "no_teleport": not handling.teleported,
        "no_spawn_overlap": not handling.spawn_overlap,
        # What was there at the adversaries' release they inherited.
        "conflict_after_release": conflict.noticed_s >= AFTER_RELEASE_S - 1e-6,
        "inside_limits": handling.inside_limits,
        "inside_grip": inside_grip(evidence, striker),
        "solid_bodies": not handling.touched_before,
        "ego_model_saw": handling.ego_model_saw,
    }


def inside_grip(evidence: Evidence, striker: int) -> bool:
    """Whether the striker's driving of the last 2 s fits into the road's friction circle: |a| ≤ 1.05 μ g.

    |a| covers braking, lane changes and cornering alike. Pedestrians pass.
    """
    if evidence.kind[striker] == Kind.PEDESTRIAN:
        return True
    used = used_grip(evidence, striker)
    return bool(used.max(initial=0.0) <= GRIP_TOLERANCE * evidence.ground.friction * GRAVITY_MPS2)


def used_grip(evidence: Evidence, striker: int) -> Floats:
    """|a| of the striker at the middle of each second within the last 2 s, m/s²; empty with less than 0.5 s on record.

    It is what the striker drove, not what it was told: x(t) ≈ x0 + v t + a t²/2 by least squares over a second of its
    front bumper's positions, and y alike; |a| = √(a_x² + a_y²). The front follows its lane, whose polyline has kinks,
    and a lateral move starts and stops within a step; a second is what a real vehicle needs to yaw.
    """
    e = evidence
    heading = e.heading_rad[:, striker]
    reach = e.length_m[striker] / 2
    front = np.stack((e.x_m[:, striker] + reach * np.cos(heading), e.y_m[:, striker] + reach * np.sin(heading)))
    first = e.since(GRIP_LOOKS_BACK_S + GRIP_WINDOW_S / 2)
    points = min(round(GRIP_WINDOW_S / e.step_s) + 1, front.shape[1] - first)
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
