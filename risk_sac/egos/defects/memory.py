"""Defects of memory and tracking: what is forgotten, confused or noticed too late."""

import math
from collections import deque
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from risk_sac.egos.defects.defective import PEDESTRIAN, VEHICLE, Defective, moving, only
from risk_sac.egos.seam import Perceived
from risk_sac.world.geometry import Sight, frame_view, in_sight
from risk_sac.world.types import HEADING, LENGTH, SPEED, VX, VY, WIDTH, X, Y

STANDING_MPS = 0.3


class NoMemory(Defective):
    """Forgets what has been out of the line of sight for some time."""

    def begin(self) -> None:
        """Has seen nothing yet."""
        self._seen_s: dict[str, float] = {}

    def sees(self, p: Perceived) -> Perceived:
        """Drops what others hide, where it is expected to be."""
        view = Sight(reach_m=math.inf, half_view_rad=math.pi, occlusion=True, unlit_m=math.inf)
        seen = in_sight(frame_view(p.state), p.kind[1:] == VEHICLE, view)
        self._seen_s |= {id_: p.time_s for id_, visible in zip(p.ids[1:], seen, strict=True) if visible}
        latest = [self._seen_s.get(id_, -math.inf) for id_ in p.ids]
        return only(p, p.time_s - np.array(latest) < self.value + 1e-6)


class StaleVelocity(Defective):
    """Takes the velocities of others from some time ago."""

    def begin(self) -> None:
        """Knows no velocity yet."""
        self._past: dict[str, deque[tuple[float, float]]] = {}

    def sees(self, p: Perceived) -> Perceived:
        """Gives others their earlier velocities."""
        for id_, vx, vy in zip(p.ids, p.state[VX].tolist(), p.state[VY].tolist(), strict=True):
            self._past.setdefault(id_, deque(maxlen=self.steps(self.value) + 1)).append((vx, vy))
        vx_mps, vy_mps = np.array([self._past[id_][0] for id_ in p.ids]).T
        return moving(p, np.ones(len(p.ids), dtype=np.bool_), vx_mps, vy_mps)


class SwapsTracks(Defective):
    """Swaps the identities and velocities of two actors that are near each other."""

    def sees(self, p: Perceived) -> Perceived:
        """Swaps the two that are nearest to each other, if they are near enough."""
        pairs = list(combinations(range(1, len(p.ids)), 2))
        apart_m = [math.hypot(*(p.state[[X, Y], i] - p.state[[X, Y], j])) for i, j in pairs]
        if not pairs or min(apart_m) > self.value:
            return p
        (i, j), ids, state = pairs[int(np.argmin(apart_m))], list(p.ids), p.state.copy()
        ids[i], ids[j] = ids[j], ids[i]
        state[np.ix_([VX, VY, SPEED], [i, j])] = p.state[np.ix_([VX, VY, SPEED], [j, i])]
        return p._replace(ids=tuple(ids), state=state)


class LateTracks(Defective):
    """Reckons with an actor only some time after it came into view."""

    def begin(self) -> None:
        """Has seen nothing yet."""
        self._since_s: dict[str, float] = {}

    def sees(self, p: Perceived) -> Perceived:
        """Drops what is new; what was there when the ego took over is not."""
        began_s = p.time_s if self._since_s else -math.inf
        self._since_s = {id_: self._since_s.get(id_, began_s) for id_ in p.ids}
        since_s = np.array([self._since_s[id_] for id_ in p.ids])
        return only(p, p.time_s - since_s > self.value - 1e-6)


class MergesPedestrians(Defective):
    """Takes a pedestrian close to a vehicle for a part of that vehicle."""

    def sees(self, p: Perceived) -> Perceived:
        """Drops pedestrians close to the bodies of vehicles."""
        vehicles = np.flatnonzero(p.kind[1:] == VEHICLE) + 1
        return only(p, np.array([not self._beside(p, i, vehicles) for i in range(len(p.ids))]))

    def _beside(self, p: Perceived, walker: int, vehicles: NDArray[np.intp]) -> bool:
        if p.kind[walker] != PEDESTRIAN:
            return False
        x, y = p.state[X, walker] - p.state[X, vehicles], p.state[Y, walker] - p.state[Y, vehicles]
        cos, sin = np.cos(p.state[HEADING, vehicles]), np.sin(p.state[HEADING, vehicles])
        along_m = np.abs(x * cos + y * sin) - p.state[LENGTH, vehicles] / 2
        across_m = np.abs(y * cos - x * sin) - p.state[WIDTH, vehicles] / 2
        return bool((np.maximum(along_m, across_m) < self.value).any())


class DropsStanding(Defective):
    """Takes a pedestrian that has stood for some time for a thing, from then on."""

    def begin(self) -> None:
        """Has seen nothing yet."""
        self._stood_s: dict[str, float] = {}

    def sees(self, p: Perceived) -> Perceived:
        """Drops pedestrians that have stood for long enough."""
        for id_, speed in zip(p.ids, np.hypot(p.state[VX], p.state[VY]), strict=True):
            stood_s = self._stood_s.get(id_, 0.0)
            if stood_s < self.value - 1e-6:
                self._stood_s[id_] = stood_s + self.step_s if speed < STANDING_MPS else 0.0
        stood = np.array([self._stood_s[id_] >= self.value - 1e-6 for id_ in p.ids])
        return only(p, ~(stood & (p.kind == PEDESTRIAN)))
