"""Defects of perception: what the sensors miss, or measure wrongly."""

import math
from collections import deque

import numpy as np

from risk_sac.egos.defects.defective import PEDESTRIAN, VEHICLE, Defective, in_front, moving, only
from risk_sac.egos.seam import Perceived
from risk_sac.world.types import HEADING, LENGTH, VX, VY, X, Y

BLIND_FROM_RAD = math.radians(20.0)  # where a blind sector begins, beside straight ahead


class ShortSight(Defective):
    """Sees nothing beyond a range."""

    def sees(self, p: Perceived) -> Perceived:
        """Drops what is farther away."""
        return only(p, np.hypot(*in_front(p)) < self.value)


class BlindSector(Defective):
    """Sees nothing in a sector of so many degrees, to the left if positive."""

    def sees(self, p: Perceived) -> Perceived:
        """Drops what is in the sector."""
        ahead_m, left_m = in_front(p)
        beyond = math.copysign(1.0, self.value) * np.arctan2(left_m, ahead_m) - BLIND_FROM_RAD
        return only(p, (beyond < 0.0) | (beyond > math.radians(abs(self.value))))


class PedestrianRange(Defective):
    """Sees no pedestrian beyond a range."""

    def sees(self, p: Perceived) -> Perceived:
        """Drops pedestrians that are farther away."""
        return only(p, (p.kind != PEDESTRIAN) | (np.hypot(*in_front(p)) < self.value))


class DropsFrames(Defective):
    """Sees nothing in every n-th frame."""

    def begin(self) -> None:
        """Counts from the first frame."""
        self._frame = 0

    def sees(self, p: Perceived) -> Perceived:
        """Drops all actors in some frames."""
        self._frame += 1
        return only(p, np.full(len(p.ids), self._frame % self.value != 0))


class Latency(Defective):
    """Sees others where they were some time ago; knows its own motion at once."""

    def begin(self) -> None:
        """Has no frames yet."""
        self._past: deque[Perceived] = deque(maxlen=self.steps(self.value) + 1)

    def sees(self, p: Perceived) -> Perceived:
        """Takes the others from an earlier frame."""
        self._past.append(p)
        then = self._past[0]
        return p._replace(ids=then.ids, kind=then.kind, state=np.hstack((p.state[:, :1], then.state[:, 1:])))


class ShortBodies(Defective):
    """Sees longer vehicles as long as a car, around the same centre."""

    def sees(self, p: Perceived) -> Perceived:
        """Shortens bodies."""
        state = p.state.copy()
        state[LENGTH, 1:] = np.minimum(state[LENGTH, 1:], self.value)
        return p._replace(state=state)


class LateralBias(Defective):
    """Sees others too far to the left, by the same distance everywhere."""

    def sees(self, p: Perceived) -> Perceived:
        """Shifts the others."""
        state, heading = p.state.copy(), p.state[HEADING, 0]
        state[X, 1:] -= self.value * math.sin(heading)
        state[Y, 1:] += self.value * math.cos(heading)
        return p._replace(state=state)


class StillPedestrians(Defective):
    """Takes pedestrians for standing up to some speed."""

    def sees(self, p: Perceived) -> Perceived:
        """Stops pedestrians."""
        slow = np.hypot(p.state[VX], p.state[VY]) < self.value
        return moving(p, (p.kind == PEDESTRIAN) & slow, 0.0, 0.0)


class RadialVelocity(Defective):
    """Measures velocities along the line of sight only, as a radar does, and a share of those across."""

    def sees(self, p: Perceived) -> Perceived:
        """Takes velocities across the line of sight away."""
        x, y = p.state[X] - p.state[X, 0], p.state[Y] - p.state[Y, 0]
        distance = np.maximum(np.hypot(x, y), 1e-6)
        x, y = x / distance, y / distance
        vx, vy, share = p.state[VX], p.state[VY], self.value
        along = vx * x + vy * y
        return moving(p, p.kind == VEHICLE, along * x + share * (vx - along * x), along * y + share * (vy - along * y))
