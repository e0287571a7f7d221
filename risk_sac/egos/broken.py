"""An ego that is wrong on purpose, late and short-sighted: a check that a search finds failures at all."""

from collections import deque

import numpy as np

from risk_sac.egos.driving import Driver, idm, stop_at_signal
from risk_sac.egos.seam import Control, Episode, Perceived
from risk_sac.types import X, Y

LATE_STEPS = 10  # it acts on what it perceived a second ago
SIGHT_M = 20.0
HEADWAY_S = 1.0


class Broken(Driver):
    """Acts on what it perceived a second ago, and perceives nothing beyond 20 m: wrong on purpose."""

    version = "1.0"
    response_time_s = 1.0

    def reset(self, episode: Episode) -> None:
        """Begins an episode."""
        super().reset(episode)
        self._decided: deque[float] = deque([0.0] * LATE_STEPS)

    def act(self, perceived: Perceived) -> Control:
        """Does what it decided a second ago; it steers in time, or it would leave its lane all by itself."""
        p = perceived
        near = np.hypot(p.state[X] - p.state[X, 0], p.state[Y] - p.state[Y, 0]) < SIGHT_M
        seen = p._replace(
            ids=tuple(id_ for id_, is_near in zip(p.ids, near, strict=True) if is_near),
            kind=p.kind[near],
            state=np.compress(near, p.state, axis=1),
        )
        signal = stop_at_signal(p) if p.stop_line_m < SIGHT_M else []
        self._decided.append(idm(seen, self.vehicle, [*self.ahead(seen), *signal], HEADWAY_S))
        return self.keeping_lane(p, self._decided.popleft())
