"""Finds which of two road users first left RSS's proper response.

A situation is dangerous while both RSS distances are too short. From when it became so until the contact, each party
may go on for the response time and has to brake from then on:

- Side by side, where the lateral distance became too short last: its motion towards the other.
- On one lane: the rear one. The one ahead brakes no harder than the hardest braking to be expected.
- On ways that cross: both, for right of way is given, not taken. One that has to yield has no response time left; a
  pedestrian with priority may walk on.

Choice: a party leaves the response when it is faster than that allows by what a braking loses that builds up at R157's
jerk.

Source: Shalev-Shwartz, Shammah, Shashua 2017, "On a Formal Model of Safe and Scalable Self-driving Cars", arXiv
1708.06374: dangerous situation, blame time and proper response.
"""

import math

import numpy as np

from risk_sac.geometry import frame_view
from risk_sac.jit import compiled
from risk_sac.records import ConflictType
from risk_sac.risk.rss import margins
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.types import HEADING, LENGTH, VX, VY, WIDTH, Bools, Floats, Kind, X, Y
from risk_sac.verdicts.along import Along
from risk_sac.verdicts.conflict import lasting_since
from risk_sac.verdicts.course import Body
from risk_sac.verdicts.drivers import JERK_MPS3
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.recorded import column, recorded_motion

RSS = RssParameters()
BUILD_UP_MPS = RSS.brake_min_mps2**2 / (2 * JERK_MPS3)
DRIFT_MPS = 0.2  # sideways, or of a pedestrian: no motion towards the other
HARDER = 1.1  # than the hardest braking to be expected, beyond what a step of 0.1 s cannot resolve


def left_first(
    evidence: Evidence, striker: int, conflict_type: ConflictType, seen: Along[Floats], yields: str | None
) -> str | None:
    """Names the party that first left the proper response: ego or striker.

    None if neither did, or both at once.

    Args:
      evidence: up to the contact.
      striker: its column.
      conflict_type: how it came into the ego's way.
      seen: the striker along the ego's path.
      yields: ego | striker: which had to yield to the other; None if neither.
    """
    began, aside = _danger(evidence, striker)
    if conflict_type in (ConflictType.PEDESTRIAN, ConflictType.CROSSING):
        left = _on_crossing_ways(evidence, striker, began, yields)
    elif aside:
        left = _side_by_side(evidence, striker, began)
    else:
        left = _on_one_lane(evidence, striker, began, seen)
    ego, other = left
    if ego == other:
        return None
    return "ego" if ego < other else "striker"


def _danger(evidence: Evidence, striker: int) -> tuple[int, bool]:
    """Finds since which frame it was dangerous, and whether the lateral distance became too short last."""
    walks = np.array([evidence.kind[striker] == Kind.PEDESTRIAN])
    along, across = _margins(recorded_motion(evidence, 0), recorded_motion(evidence, striker), walks, RSS)
    dangerous = (along < 0.0) & (across < 0.0)
    began = lasting_since(dangerous, dangerous)
    return began, bool(across[began - 1] >= 0.0 > along[began - 1]) if began else False


def _on_crossing_ways(evidence: Evidence, striker: int, began: int, yields: str | None) -> tuple[float, float]:
    """Finds the frames in which ego and striker leave the response; inf if they do not."""
    walks = evidence.kind[striker] == Kind.PEDESTRIAN
    speed = column(evidence.speed_mps, striker)
    ego = _leaves(evidence, column(evidence.speed_mps, 0), began, RSS.brake_min_mps2, BUILD_UP_MPS, yields == "ego")
    if not walks:
        return ego, _leaves(evidence, speed, began, RSS.brake_min_mps2, BUILD_UP_MPS, yields == "striker")
    if yields == "ego":
        return ego, math.inf
    return ego, _leaves(evidence, speed, began, RSS.walk_brake_mps2, DRIFT_MPS, yields == "striker")


def _side_by_side(evidence: Evidence, striker: int, began: int) -> tuple[float, float]:
    e = evidence
    dx, dy = (float(each[began, striker] - each[began, 0]) for each in (e.x_m, e.y_m))
    heading = float(e.heading_rad[began, 0])
    side = math.copysign(1.0, dy * math.cos(heading) - dx * math.sin(heading))
    ego, other = (
        _leaves(e, towards * e.lateral_mps[:, actor], began, RSS.lateral_brake_mps2, DRIFT_MPS)
        for actor, towards in ((0, side), (striker, -side))
    )
    return ego, other


def _on_one_lane(evidence: Evidence, striker: int, began: int, seen: Along[Floats]) -> tuple[float, float]:
    rear, front = (striker, 0) if seen.behind_m[began] > 0.0 else (0, striker)
    rear_left = _leaves(evidence, column(evidence.speed_mps, rear), began, RSS.brake_min_mps2, BUILD_UP_MPS)
    harder = np.flatnonzero(evidence.accel_mps2[began:, front] < -HARDER * RSS.brake_max_mps2)
    front_left = float(began + harder[0]) if len(harder) else math.inf
    return (front_left, rear_left) if rear == striker else (rear_left, front_left)


def _leaves(
    evidence: Evidence, speed: Floats, began: int, brake_mps2: float, tolerance_mps: float, yields: bool = False
) -> float:
    """Finds the first frame with a speed above the proper response's; inf if none.

    The speed is the one towards the other.

    One that has to yield responds at once.
    """
    responds = began + (0 if yields else round(RSS.response_s / evidence.step_s))
    if responds >= len(speed):
        return math.inf
    since_s = np.arange(len(speed) - responds) * evidence.step_s
    allowed = np.maximum(speed[responds] - brake_mps2 * since_s, 0.0) + tolerance_mps
    faster = np.flatnonzero(speed[responds:] > allowed)
    return float(responds + faster[0]) if len(faster) else math.inf


@compiled
def _margins(ego: Body[Floats], other: Body[Floats], walks: Bools, parameters: RssParameters) -> tuple[Floats, Floats]:
    """Measures the longitudinal and the lateral RSS margin of each frame, m."""
    along, across = np.empty(len(ego.x)), np.empty(len(ego.x))
    state = np.zeros((WIDTH + 1, 2))
    for i, body in enumerate((ego, other)):
        state[LENGTH, i], state[WIDTH, i] = 2 * body.size.half_length, 2 * body.size.half_width
    for t in range(len(along)):
        for i, body in enumerate((ego, other)):
            state[X, i], state[Y, i], state[HEADING, i] = body.x[t], body.y[t], body.heading[t]
            state[VX, i], state[VY, i] = body.vx[t], body.vy[t]
        found = margins(frame_view(state), walks, parameters)
        along[t], across[t] = found.longitudinal_m[0], found.lateral_m[0]
    return along, across
