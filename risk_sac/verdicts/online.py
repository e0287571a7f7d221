"""Finds conflicts of the present frame, for driving egos and starting scenes.

The measures are those of `risk_sac.verdicts.present`.
"""

import math
from typing import Protocol

import numpy as np

from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.verdicts.course import HORIZON_S, Path
from risk_sac.verdicts.defensive import PRIORITY, PRIORITY_S, SceneAhead, allowed_accel, nothing_remembered
from risk_sac.verdicts.drivers import R157_PERCEIVES_S, r157
from risk_sac.verdicts.evidence import Ground
from risk_sac.verdicts.present import OnPath, concealing, conflict_in, crossings_on, street_of
from risk_sac.world.geometry import size_of
from risk_sac.world.types import STEP_S, Bools, Frame, Kind

LEAST_MPS2 = 1e-6  # braking that only keeps the ego from speeding up
LEAST_ACCEL_MPS2 = 0.5  # Choice: a restraint to more is none; SUMO's driver can be told to brake, not how to speed up
OVER_S = 1.0  # a conflict that has been gone for so long is over


def conflicts_now(frame: Frame, path: Path, known: Bools, ground: Ground, *, wary: bool = False) -> Bools:
    """Tells with which of `frame.ids` a driver in the ego's place conflicts.

    A crossing vehicle that has to stop or to yield, and still can at 3.4 m/s², is expected to: in a record the contact
    shows that it did not.

    `path` is the ego's path ahead, from its centre; `known` marks the actors that the ego knows of, `n`. For a wary
    driver a vehicle that hangs over beside the ego counts even if it does not come nearer, and a braking vehicle is not
    trusted.

    Returns:
      `n`; False for the ego.
    """
    found = np.zeros(len(frame.ids), dtype=np.bool_)
    apart_m = np.hypot(frame.x_m - frame.x_m[0], frame.y_m - frame.y_m[0]) - (frame.length_m + frame.length_m[0])
    within_reach = apart_m <= HORIZON_S * (frame.speed_mps + frame.ego_speed_mps)
    within_reach[0] = False
    street = street_of(ground)
    ego = OnPath(path, 0, float(path.s[0]), frame.ego_speed_mps, size_of(frame.state, 0))
    for i in np.flatnonzero(known & within_reach):
        vehicle, link = bool(frame.kind[i] == Kind.VEHICLE), int(frame.link[i])
        found[i] = conflict_in(ego, frame.state, int(i), vehicle, link, street, wary) < math.inf
    return found


class Reflex(Protocol):
    """Braking beside SUMO's models, for one episode of a SUMO-driven ego."""

    def braking(self, frame: Frame, path: Path, seen: Bools) -> float:
        """Computes its braking now, m/s²; 0 leaves driving to SUMO's models."""


def reflex_of(profile: str, ground: Ground) -> Reflex | None:
    """The reflex of an ego's profile; None where it has none."""
    return R157Reflex(ground) if profile == "careful" else DefensiveReflex(ground) if profile == "defensive" else None


class R157Reflex:
    """R157's driver in the closed loop; one for each episode.

    It drives as the ego does, and brakes as `r157` says from the moment it perceives a conflict, if that is harder.
    """

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._since_s: float | None = None
        self._last_s = 0.0

    def braking(self, frame: Frame, path: Path, seen: Bools) -> float:
        """Computes the braking, m/s²; 0 without perceived conflict. Arguments: see `conflicts_now`."""
        now = frame.time_s
        if conflicts_now(frame, path, seen, self._ground).any():
            self._since_s, self._last_s = (now if self._since_s is None else self._since_s), now
        elif self._since_s is not None and now - self._last_s > OVER_S:
            self._since_s = None
        if self._since_s is None or now - self._since_s < R157_PERCEIVES_S:
            return 0.0
        return r157(now - self._since_s - R157_PERCEIVES_S, self._ground.friction * GRAVITY_MPS2)


class DefensiveReflex:
    """The defensive driver in the closed loop; one for each episode.

    It drives as the ego does where `allowed_accel` restrains it less.
    """

    def __init__(self, ground: Ground) -> None:
        self._street = street_of(ground)
        self._ids: tuple[str, ...] = ()
        self._conceals = concealing(())
        self._memory = nothing_remembered(0)
        self._priority_s = -math.inf  # when its signal last gave it priority

    def braking(self, frame: Frame, path: Path, seen: Bools) -> float:
        """Computes the braking, m/s²; 0 if unrestrained. Arguments: see `conflicts_now`."""
        if frame.ids != self._ids:
            before, self._memory = self._memory, nothing_remembered(len(frame.ids))
            for column, id_ in enumerate(frame.ids):
                if id_ in self._ids:
                    self._memory[:, column] = before[:, self._ids.index(id_)]
            self._ids, self._conceals = frame.ids, concealing(frame.body)
        if frame.link[0] == PRIORITY:
            self._priority_s = frame.time_s
        priority = frame.link[0] in (0, PRIORITY) and frame.time_s - self._priority_s <= PRIORITY_S
        size = size_of(frame.state, 0)
        ego = OnPath(path, 0, float(path.s[0]), frame.ego_speed_mps, size)
        crossings = crossings_on(path, ego.s, float(path.s[-1]), self._street.boxes, size.half_width)
        everything = np.ones(len(frame.ids), dtype=np.bool_)
        actors = frame.kind == Kind.VEHICLE, self._conceals, frame.link, seen
        scene = SceneAhead(frame.state, *actors, priority, everything, True, 0, math.inf)
        accel = allowed_accel(ego, scene, self._street, crossings, self._memory, STEP_S)
        # SUMO's driver speeds up by itself: the least braking keeps it from that.
        return max(-accel, LEAST_MPS2) if accel < LEAST_ACCEL_MPS2 else 0.0
