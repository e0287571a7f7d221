"""Overlapping bodies in a record: from its first frame to the contact no two may share a place."""

from typing import NamedTuple

import numpy as np

from risk_sac.geometry import overlapping_pairs
from risk_sac.types import HEADING, LENGTH, WIDTH, X, Y
from risk_sac.verdicts.evidence import Evidence


class Overlap(NamedTuple):
    """Two bodies that overlap in one frame."""

    time_s: float  # from the adversaries' release; negative before it
    first: str
    second: str


def overlaps_before_contact(evidence: Evidence) -> list[Overlap]:
    """Finds each frame's overlapping bodies; whom the ego touches in the last frame is left out."""
    e = evidence
    last = len(e.time_s) - 1
    state = np.zeros((WIDTH + 1, len(e.ids)))
    state[LENGTH], state[WIDTH] = e.length_m, e.width_m
    found = []
    for frame, time_s in enumerate(e.time_s.tolist()):
        state[X], state[Y], state[HEADING] = e.x_m[frame], e.y_m[frame], e.heading_rad[frame]
        for i, j in overlapping_pairs(state):
            if i > 0 or frame < last:
                found.append(Overlap(time_s, e.ids[i], e.ids[j]))
    return found
