"""What the ego perceives: a line-of-sight sensor and the memory of who was seen since when."""

import math

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


class Perception:
    """Whom the ego knows of, and since when without a break.

    An actor is known while it is in sight and for the sensor's memory afterwards.
    """

    def __init__(self, memory_s: float) -> None:
        self._memory_s = memory_s
        self._known_since: dict[str, float] = {}
        self._last_seen: dict[str, float] = {}

    def reset(self) -> None:
        """Forgets the previous episode."""
        self._known_since.clear()
        self._last_seen.clear()

    def update(self, frame: Frame, seen: Bools) -> frozenset[str]:
        """Looks at a frame.

        Args:
          frame: all actors, the ego first.
          seen: which of the others are in sight.

        Returns:
          The ids that must be hidden from the ego's models.
        """
        now, forgotten = frame.time_s, frame.time_s - self._memory_s - TIME_TOLERANCE_S
        known_since, last_seen = self._known_since, self._last_seen
        hidden = []
        for id_, in_sight in zip(frame.ids[1:], seen.tolist(), strict=True):
            if in_sight:
                last_seen[id_] = now
                if id_ not in known_since:
                    known_since[id_] = now
            elif last_seen.get(id_, -math.inf) < forgotten:
                known_since.pop(id_, None)
                hidden.append(id_)
        return frozenset(hidden)

    def known_for(self, id_: str, time_s: float) -> float:
        """How long the ego has known of `id_` without a break, s; 0 if it does not."""
        since = self._known_since.get(id_)
        return 0.0 if since is None else time_s - since

    def ever_seen(self, id_: str) -> bool:
        """Whether `id_` has been in sight at any time in this episode."""
        return id_ in self._last_seen
