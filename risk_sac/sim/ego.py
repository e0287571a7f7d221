"""What the ego perceives: a line-of-sight sensor and the memory of who was seen since when."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from risk_sac.config import SensorConfig
from risk_sac.geometry import Sight
from risk_sac.types import Bools, Frame


def sight(sensor: SensorConfig | None, visibility_m: float) -> Sight:
    """The best the ego can see; None sees everything.

    Args:
      sensor: its range, opening angle and whether bodies occlude.
      visibility_m: the weather's bound on the range.
    """
    if sensor is None:
        return Sight(reach_m=math.inf, half_view_rad=math.pi, occlusion=False)
    return Sight(min(sensor.range_m, visibility_m), sensor.field_of_view_rad / 2, sensor.occlusion)


TIME_TOLERANCE_S = 1e-6  # SUMO counts milliseconds, we add floats
FLICKER_S = 0.5  # out of sight for no longer, an actor was in view without a break


class Glimpse(NamedTuple):
    """An actor as it was last seen."""

    time_s: float
    x_m: float
    y_m: float
    heading_rad: float
    vx_mps: float
    vy_mps: float

    @classmethod
    def of(cls, frame: Frame, row: int) -> "Glimpse":
        """An actor of a frame."""
        x_m, y_m, heading_rad, vx_mps, vy_mps = (float(getattr(frame, name)[row]) for name in cls._fields[1:])
        return cls(frame.time_s, x_m, y_m, heading_rad, vx_mps, vy_mps)

    def moved_on(self, time_s: float) -> "Glimpse":
        """Where it is expected to be, if it keeps its velocity."""
        ahead_s = time_s - self.time_s
        return self._replace(time_s=time_s, x_m=self.x_m + ahead_s * self.vx_mps, y_m=self.y_m + ahead_s * self.vy_mps)


class Belief(NamedTuple):
    """What the ego makes of what it does not see."""

    hidden: frozenset[str]  # of whom it knows nothing
    expected: Mapping[str, Glimpse]  # whom it remembers


NOTHING_HIDDEN = Belief(frozenset(), {})


class Perception:
    """Whom the ego sees, and whom it remembers.

    An actor is remembered for the sensor's memory after it went out of sight, and expected to go on as it did then.
    """

    def __init__(self, memory_s: float) -> None:
        self._memory_s = memory_s
        self._in_view_since: dict[str, float] = {}
        self._last_seen: dict[str, tuple[Frame, int]] = {}  # and the row in it

    def reset(self) -> None:
        """Forgets the previous episode."""
        self._in_view_since.clear()
        self._last_seen.clear()

    def update(self, frame: Frame, seen: Bools) -> Belief:
        """Looks at a frame.

        Args:
          frame: all actors, the ego first.
          seen: which of the others are in sight.
        """
        now, last_seen = frame.time_s, self._last_seen
        hidden, expected = [], {}
        for row, (id_, in_sight) in enumerate(zip(frame.ids[1:], seen.tolist(), strict=True), start=1):
            seen_in = last_seen.get(id_)
            unseen_s = math.inf if seen_in is None else now - seen_in[0].time_s
            if unseen_s > FLICKER_S + TIME_TOLERANCE_S:
                self._in_view_since.pop(id_, None)
            if in_sight:
                last_seen[id_] = frame, row
                self._in_view_since.setdefault(id_, now)
            elif seen_in is not None and unseen_s <= self._memory_s + TIME_TOLERANCE_S:
                expected[id_] = Glimpse.of(*seen_in).moved_on(now)
            else:
                hidden.append(id_)
        return Belief(frozenset(hidden), expected)

    def in_view_for(self, id_: str, time_s: float) -> float:
        """How long `id_` has been in sight without a break, s; 0 if it is not."""
        since = self._in_view_since.get(id_)
        return 0.0 if since is None else time_s - since

    def ever_seen(self, id_: str) -> bool:
        """Whether `id_` has been in sight at any time in this episode."""
        return id_ in self._last_seen
