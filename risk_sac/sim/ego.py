"""The ego's perception: a line-of-sight sensor, and a memory of seen actors."""

import math
from typing import NamedTuple, Protocol

import numpy as np

from risk_sac.config import SensorConfig
from risk_sac.scenario.bodies import body_of
from risk_sac.world.geometry import Sight, bodies_in_sight, frame_view
from risk_sac.world.jit import compiled
from risk_sac.world.types import HEADING, VX, VY, Bools, Floats, Frame, X, Y

EVERYTHING = Sight(reach_m=math.inf, half_view_rad=math.pi, occlusion=False)


def sight(sensor: SensorConfig | None, visibility_m: float, unlit_m: float = math.inf) -> Sight:
    """Combines a sensor with visibility; without a sensor visibility alone counts.

    Args:
      sensor: of the ego.
      visibility_m: in the episode's weather.
      unlit_m: the same of bodies that carry no light.
    """
    if sensor is None:
        return EVERYTHING._replace(reach_m=visibility_m, unlit_m=unlit_m)
    return Sight(min(sensor.range_m, visibility_m), sensor.field_of_view_rad / 2, sensor.occlusion, unlit_m)


TIME_TOLERANCE_S = 1e-6  # SUMO counts milliseconds, we add floats
FLICKER_S = 0.5  # out of sight for no longer, an actor was in view without a break


# Rows of the memory, one column for each actor: when it was last seen, and since when without a break, s, NaN if not;
# then the first rows of its state when it was last seen.
SEEN_S, SINCE_S, THEN = 0, 1, 2
MOTION = (X, Y, HEADING, VX, VY)


class Belief(NamedTuple):
    """The ego's belief about the `n` actors of a frame."""

    known: Bools  # of the rest it knows nothing
    state: Floats  # the frame's, but those that it remembers are where it expects them


class Senses(Protocol):
    """Perception of the ego; the simulation calls `look` once per frame."""

    def reset(self) -> None:
        """Begins an episode."""

    def look(self, frame: Frame) -> Belief:
        """The ego's belief about a frame."""


class Perception:
    """Actors that the ego sees or remembers.

    An actor out of sight is remembered for the sensor's memory, and expected to keep its velocity.

    Attributes:
      sight: in the weather of the episode.
      seen: which of the others of the latest frame are in sight, `n - 1`.
    """

    def __init__(self, memory_s: float, sight: Sight) -> None:
        self._memory_s = memory_s
        self.sight = sight
        self.reset()

    def reset(self) -> None:
        """Forgets the previous episode."""
        self._ids: tuple[str, ...] = ()
        self._memory = np.empty((THEN + len(MOTION), 0))
        self.seen: Bools = np.empty(0, dtype=np.bool_)

    def look(self, frame: Frame) -> Belief:
        """See `Senses.look`."""
        if frame.ids is not self._ids:
            bodies = [body_of(code) for code in frame.body[1:].tolist()]
            self._conceals = np.array([body.conceals for body in bodies], dtype=np.bool_)
            self._lit = np.array([body.lit for body in bodies], dtype=np.bool_)
            self._memory = np.array([self._of(id_) for id_ in frame.ids]).T.copy()
            self._ids = frame.ids
        self.seen, known, state = _look(
            self._memory, frame.state, self._conceals, self._lit, frame.time_s, self._memory_s, *self.sight
        )
        return Belief(known, state)

    def _of(self, id_: str) -> Floats:
        if id_ not in self._ids:
            return np.full(len(self._memory), np.nan)
        column: Floats = self._memory[:, self._ids.index(id_)]
        return column

    def in_view_for(self, id_: str, time_s: float) -> float:
        """Returns how long `id_` has been continuously in sight, s.

        It is 0 if it is out of sight.
        """
        since_s = float(self._of(id_)[SINCE_S])
        return 0.0 if math.isnan(since_s) else time_s - since_s

    def ever_seen(self, id_: str) -> bool:
        """Tells whether `id_` has been in sight in this episode.

        It must not have left the net since.
        """
        return not math.isnan(self._of(id_)[SEEN_S])


@compiled
def _look(
    memory: Floats,
    state: Floats,
    conceals: Bools,
    lit: Bools,
    now_s: float,
    memory_s: float,
    reach_m: float,
    half_view_rad: float,
    occlusion: bool,
    unlit_m: float,
) -> tuple[Bools, Bools, Floats]:
    """Updates the memory; returns the others in sight, and both belief parts."""
    seen = bodies_in_sight(frame_view(state), conceals, lit, Sight(reach_m, half_view_rad, occlusion, unlit_m))
    n = state.shape[1]
    known, believed = np.ones(n, dtype=np.bool_), state.copy()
    for i in range(1, n):
        unseen_s = now_s - memory[SEEN_S, i]  # NaN: never seen
        if not unseen_s <= FLICKER_S + TIME_TOLERANCE_S:
            memory[SINCE_S, i] = np.nan
        if seen[i - 1]:
            memory[SEEN_S, i] = now_s
            if math.isnan(memory[SINCE_S, i]):
                memory[SINCE_S, i] = now_s
            for k, row in enumerate(MOTION):
                memory[THEN + k, i] = state[row, i]
        elif unseen_s <= memory_s + TIME_TOLERANCE_S:
            for k, row in enumerate(MOTION):
                believed[row, i] = memory[THEN + k, i]
            believed[X, i] += unseen_s * believed[VX, i]  # it goes on as it did
            believed[Y, i] += unseen_s * believed[VY, i]
        else:
            known[i] = False
    return seen, known, believed
