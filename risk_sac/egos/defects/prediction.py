"""Defects of prediction: what is expected of others against the evidence."""

import math
from collections import deque

import numpy as np

from risk_sac.egos.defects.defective import PEDESTRIAN, VEHICLE, Defective, in_front, moving, turned
from risk_sac.egos.seam import Perceived
from risk_sac.sim.lookout import project
from risk_sac.world.types import HEADING, VX, VY, Floats, X, Y

SAME_WAY, CROSSING = 0.7, 0.7  # cosines of headings: above the one the same way, within the other across


def offsets(p: Perceived) -> Floats:
    """Returns how far the actors' centres are from the ego's line along its path, to the left, m."""
    return np.array([project(p.path, x, y)[1] - p.offset_m for x, y in p.state[[X, Y]].T.tolist()])


class LeaderDrivesOn(Defective):
    """Takes a vehicle ahead that brakes for one that goes on at the highest speed of the last seconds."""

    def begin(self) -> None:
        """Knows no speed yet."""
        self._past: dict[str, deque[float]] = {}

    def sees(self, p: Perceived) -> Perceived:
        """Gives vehicles on the ego's way the highest of their recent speeds."""
        for id_, speed in zip(p.ids, np.hypot(p.state[VX], p.state[VY]).tolist(), strict=True):
            self._past.setdefault(id_, deque(maxlen=self.steps(self.value) + 1)).append(speed)
        highest, heading = np.array([max(self._past[id_]) for id_ in p.ids]), p.state[HEADING]
        same_way = (p.kind == VEHICLE) & (turned(p) > SAME_WAY)
        return moving(p, same_way, highest * np.cos(heading), highest * np.sin(heading))


class CrossingYields(Defective):
    """Trusts every crossing vehicle to stop where it is, if it is farther away than some distance."""

    def sees(self, p: Perceived) -> Perceived:
        """Stops crossing vehicles."""
        across = (p.kind == VEHICLE) & (np.abs(turned(p)) < CROSSING) & (np.hypot(*in_front(p)) > self.value)
        return moving(p, across, 0.0, 0.0)


class KerbWaits(Defective):
    """Expects a pedestrian that is some distance or more beside the ego's line to wait there."""

    def sees(self, p: Perceived) -> Perceived:
        """Stops pedestrians beside its way."""
        return moving(p, (p.kind == PEDESTRIAN) & (np.abs(offsets(p)) > self.value), 0.0, 0.0)


class NeighboursKeepLane(Defective):
    """Expects vehicles beside its line, by some distance or more, to stay beside it."""

    def sees(self, p: Perceived) -> Perceived:
        """Takes velocities across the ego's way away."""
        beside = (p.kind == VEHICLE) & (turned(p) > SAME_WAY) & (np.abs(offsets(p)) > self.value)
        cos, sin = math.cos(p.state[HEADING, 0]), math.sin(p.state[HEADING, 0])
        along = p.state[VX] * cos + p.state[VY] * sin
        return moving(p, beside, along * cos, along * sin)
