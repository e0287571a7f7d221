"""Finds bodies that overlap in a record before the contact; none should."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from risk_sac.scenario.bodies import body_of
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.sim.collision import Contact
from risk_sac.verdicts.conflict import Conflict
from risk_sac.verdicts.course import along_series, recorded_path
from risk_sac.verdicts.evidence import Evidence, column, recorded_motion, recorded_size
from risk_sac.verdicts.offences import EGO, R157_GAP_M, RECENT_S, intrusion, leaves_room, on_inherited_red
from risk_sac.world.geometry import overlapping_pairs
from risk_sac.world.jit import compiled
from risk_sac.world.types import HEADING, LENGTH, WIDTH, Floats, Kind, Role, X, Y


class Overlap(NamedTuple):
    """Two bodies that overlap in one frame."""

    time_s: float  # from the adversaries' release; negative before it
    first: str
    second: str


def overlaps_before_contact(evidence: Evidence) -> list[Overlap]:
    """Finds overlapping bodies per frame, except the ego's contact in the last."""
    e = evidence
    pairs = _overlaps(e.x_m, e.y_m, e.heading_rad, e.length_m, e.width_m)
    return [Overlap(float(e.time_s[frame]), e.ids[i], e.ids[j]) for frame, i, j in pairs]


@compiled
def _overlaps(x: Floats, y: Floats, heading: Floats, length: Floats, width: Floats) -> list[tuple[int, int, int]]:
    """Finds frame and columns of each overlap.

    `x`, `y` and `heading` are `T x n`, NaN where an actor has left.
    """
    steps, n = x.shape
    found = [(0, 0, 0) for _ in range(0)]  # an empty list with a type that the compiler infers
    state = np.zeros((WIDTH + 1, n))
    state[LENGTH], state[WIDTH] = length, width
    for frame in range(steps):
        state[X], state[Y], state[HEADING] = x[frame], y[frame], heading[frame]
        for i, j in overlapping_pairs(state):
            if i > 0 or frame < steps - 1:
                found.append((frame, i, j))
    return found


RELEASE_S = 1e-6  # SUMO counts milliseconds, we add floats
AFTER_RELEASE_S = 1.0
GRIP_LOOKS_BACK_S = 2.0
GRIP_WINDOW_S = 1.0
GRIP_TOLERANCE = 1.05
LEAST_POINTS = 5

FLANK_FROM_FRONT_M = 1.5  # a flank contact nearer to the front bumper than this is a front corner
STANDING_MPS = 0.5
CROSSING_HEADING_SIN = 0.5  # headings at least 30 degrees apart: a crossing conflict, not a sideswipe
CROSSING_VISIBLE_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeFacts:
    """Facts of a contact that only the running episode knows."""

    teleported: bool
    inside_limits: bool  # every adversary, up to the contact
    simulator_agrees: bool | None  # see `Collision`
    visible_for_s: float  # how long the ego has seen the striker without a break, 0 if it does not
    ever_visible: bool


def artefact_verdicts(evidence: Evidence, striker: int, conflict: Conflict, facts: EpisodeFacts) -> Mapping[str, bool]:
    """The rules of `ARTEFACT_RULES`, each with whether the contact passes it."""
    overlaps = overlaps_before_contact(evidence)
    return {
        "no_teleport": not facts.teleported,
        "no_spawn_overlap": not any(each.time_s <= RELEASE_S for each in overlaps),
        # What was there at the adversaries' release they and the ego inherited, but for what a story prescribes.
        "conflict_after_release": evidence.tells_story
        or (begins_after_release(conflict.noticed_s) and not on_inherited_red(evidence)),
        "inside_limits": facts.inside_limits,
        "inside_grip": inside_grip(evidence, striker),
        "solid_bodies": not any(each.time_s > RELEASE_S for each in overlaps),
        "ego_model_saw": facts.simulator_agrees is not False,
    }


def begins_after_release(time_s: float) -> bool:
    """Whether a conflict or violation begins late enough after the release."""
    return time_s >= AFTER_RELEASE_S - 1e-6


def validity_verdicts(evidence: Evidence, striker: int, contact: Contact, facts: EpisodeFacts) -> Mapping[str, bool]:
    """Returns whether the last frame's contact passes each of the other rules."""
    adversary_hit_flank = (
        contact.ego_zone in ("left", "right")
        and evidence.length_m[0] / 2 - contact.x_m > FLANK_FROM_FRONT_M
        and contact.closing_lateral_other_mps > contact.closing_lateral_ego_mps
    )
    crossing_conflict = (
        (evidence.kind[striker] == Kind.VEHICLE or body_of(int(evidence.body[striker])).rides)
        and abs(contact.heading_sin) >= CROSSING_HEADING_SIN
        and facts.visible_for_s >= CROSSING_VISIBLE_S
    )
    return {
        "not_from_behind": contact.ego_zone != "rear" or cuts_off(evidence, striker),
        "ego_moving": bool(evidence.speed_mps[-1, 0] >= STANDING_MPS),
        "no_sideswipe": bool(not adversary_hit_flank or crossing_conflict),
        "seen_before": facts.ever_visible,
    }


def cuts_off(evidence: Evidence, striker: int) -> bool:
    """Whether the ego cut in within 3 s and left no room.

    The rule for room is that of `changes_lane_unsafely`, with the striker behind. The ego came over if it moved further
    towards the striker's way than the striker towards it.
    """
    e = evidence
    path = recorded_path(e.x_m[:, striker], e.y_m[:, striker], e.heading_rad[:, striker])
    speed_mps, size = column(e.speed_mps, striker), recorded_size(e, striker)
    seen = along_series(path, speed_mps, size, recorded_motion(e, EGO))
    t, first = intrusion(e, EGO, striker, seen), e.since(RECENT_S)
    if t == 0 or t < first:
        return False
    side = math.copysign(1.0, seen.across_m[t - 1])
    both_m = side * float(seen.across_m[first] - seen.across_m[-1])
    striker_m = side * float(e.lateral_mps[first + 1 :, striker].sum()) * e.step_s
    return both_m > 2 * max(striker_m, 0.0) and not leaves_room(float(speed_mps[t]), seen, t, R157_GAP_M)


def inside_grip(evidence: Evidence, striker: int) -> bool:
    """Tells whether the striker's driving stays within the friction circle.

    In the last 2 s: |a| ≤ 1.05 μ g.

    |a| covers braking, lane changes and cornering alike. Pedestrians pass, and actors that follow a story exactly.
    """
    if evidence.kind[striker] == Kind.PEDESTRIAN or evidence.role[striker] == Role.STORY:
        return True
    used = used_grip(evidence, striker)
    return bool(used.max(initial=0.0) <= GRIP_TOLERANCE * evidence.ground.friction * GRAVITY_MPS2)


def used_grip(evidence: Evidence, striker: int) -> Floats:
    """Estimates the striker's |a| in windows of the last 2 s, m/s².

    A value belongs to the middle of a window of 1 s; with less than 0.5 s on record there is none.

    It is the driven, not the commanded acceleration: x(t) ≈ x0 + v t + a t²/2 by least squares over a second of its
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
    """Returns weights for the t² coefficient of a least-squares quadratic of samples."""
    t = (np.arange(points) - (points - 1) / 2) * step_s
    weights: Floats = np.linalg.pinv(np.stack((np.ones(points), t, t * t), axis=1))[2]
    return weights
