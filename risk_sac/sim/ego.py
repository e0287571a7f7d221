"""What the ego perceives: a line-of-sight sensor and the memory of who was seen since when."""

import math

import numpy as np

from risk_sac.config import SensorConfig
from risk_sac.geometry import RelativeView, line_of_sight
from risk_sac.jit import compiled
from risk_sac.types import Bools, Frame, Kind


def visible(view: RelativeView, vehicle: Bools, sensor: SensorConfig | None, visibility_m: float) -> Bools:
    """Which of the `n` other actors the ego's sensor sees.

    Args:
      view: the others in the ego's frame.
      vehicle: `n`; vehicles occlude what is behind them, pedestrians do not.
      sensor: None sees everything.
      visibility_m: the weather's bound on the sensor's range.
    """
    if sensor is None:
        return np.ones(len(view.x), dtype=np.bool_)
    reach_m = min(sensor.range_m, visibility_m)
    return _visible(view, vehicle, reach_m, sensor.field_of_view_rad / 2, sensor.occlusion)


@compiled
def _visible(view: RelativeView, vehicle: Bools, reach_m: float, half_view_rad: float, occlusion: bool) -> Bools:
    seen = line_of_sight(view, vehicle) if occlusion else np.ones(len(view.x), dtype=np.bool_)
    for i in range(len(seen)):
        x, y = view.x[i], view.y[i]
        if x * x + y * y > reach_m * reach_m or abs(math.atan2(y, x)) > half_view_rad:
            seen[i] = False
    return seen


TIME_TOLERANCE_S = 1e-6  # SUMO counts milliseconds, we add floats


class Perception:
    """Whom the ego knows of, and since when without a break.

    An actor is known while it is in sight and for the sensor's memory afterwards.
    """

    def __init__(self, sensor: SensorConfig | None, visibility_m: float) -> None:
        self._sensor = sensor
        self._visibility_m = visibility_m
        self._memory_s = 0.0 if sensor is None else sensor.memory_s
        self._known_since: dict[str, float] = {}
        self._last_seen: dict[str, float] = {}

    def reset(self) -> None:
        """Forgets the previous episode."""
        self._known_since.clear()
        self._last_seen.clear()

    def update(self, frame: Frame, view: RelativeView) -> tuple[Bools, frozenset[str]]:
        """Looks at a frame.

        Returns:
          `n - 1` flags of the other actors in sight, and the ids that must be hidden from the ego's models.
        """
        seen = visible(view, frame.kind[1:] == Kind.VEHICLE, self._sensor, self._visibility_m)
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
        return seen, frozenset(hidden)

    def known_for(self, id_: str, time_s: float) -> float:
        """How long the ego has known of `id_` without a break, s; 0 if it does not."""
        since = self._known_since.get(id_)
        return 0.0 if since is None else time_s - since

    def ever_seen(self, id_: str) -> bool:
        """Whether `id_` has been in sight at any time in this episode."""
        return id_ in self._last_seen
