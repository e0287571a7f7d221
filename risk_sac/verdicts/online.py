"""Finds conflicts of the present frame, for egos that drive and for scenes that begin.

The measures are those of `risk_sac.verdicts.present`.
"""

import math

import numpy as np

from risk_sac.geometry import size_of
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.types import Bools, Frame, Kind
from risk_sac.verdicts.course import HORIZON_S
from risk_sac.verdicts.drivers import R157_PERCEIVES_S, r157
from risk_sac.verdicts.evidence import Ground
from risk_sac.verdicts.path import Path
from risk_sac.verdicts.present import OnPath, conflict_in, street_of

OVER_S = 1.0  # a conflict that has been gone for so long is over


def conflicts_now(frame: Frame, path: Path, known: Bools, ground: Ground, *, wary: bool = False) -> Bools:
    """Which of `frame.ids` a driver in the ego's place is in a conflict with.

    A crossing vehicle that has to stop or to yield, and still can at 3.4 m/s², is expected to: in a record the contact
    tells that it did not.

    `path` is the ego's path ahead, from its centre; `known` says whom the ego knows of, `n`. For a wary driver whoever
    hangs over beside the ego counts, if it comes nearer or not, and who brakes is not trusted.

    Returns:
      `n`; False for the ego.
    """
    found = np.zeros(len(frame.ids), dtype=np.bool_)
    apart_m = np.hypot(frame.x_m - frame.x_m[0], frame.y_m - frame.y_m[0]) - (frame.length_m + frame.length_m[0])
    within_reach = apart_m <= HORIZON_S * (frame.speed_mps + frame.ego_speed_mps)
    within_reach[0] = False
    street = street_of(ground, ground.friction * GRAVITY_MPS2)
    ego = OnPath(path, 0, float(path.s[0]), frame.ego_speed_mps, size_of(frame.state, 0))
    for i in np.flatnonzero(known & within_reach):
        vehicle, link = bool(frame.kind[i] == Kind.VEHICLE), int(frame.link[i])
        found[i] = conflict_in(ego, frame.state, int(i), vehicle, link, street, wary) < math.inf
    return found


class R157Reflex:
    """R157's driver in the closed loop; one for each episode.

    It drives as the ego does, and brakes as `r157` says from the moment it perceives a conflict, if that is harder.
    """

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._since_s: float | None = None
        self._last_s = 0.0

    def braking(self, frame: Frame, path: Path, seen: Bools) -> float:
        """How hard it brakes now, m/s²; 0 while it perceives no conflict. Arguments as of `conflicts_now`."""
        now = frame.time_s
        if conflicts_now(frame, path, seen, self._ground).any():
            self._since_s, self._last_s = (now if self._since_s is None else self._since_s), now
        elif self._since_s is not None and now - self._last_s > OVER_S:
            self._since_s = None
        if self._since_s is None or now - self._since_s < R157_PERCEIVES_S:
            return 0.0
        return r157(now - self._since_s - R157_PERCEIVES_S, self._ground.friction * GRAVITY_MPS2)
