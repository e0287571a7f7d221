"""The careful driver at the wheel: the judge's driver, but in the closed loop.

It drives as the ego does, and brakes as `careful` says from the moment it perceives a conflict, if that is harder.
"""

from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.types import Bools, Frame
from risk_sac.verdicts.drivers import CAREFUL_PERCEIVES_S, careful
from risk_sac.verdicts.evidence import Ground
from risk_sac.verdicts.online import conflicts_now
from risk_sac.verdicts.path import Path

OVER_S = 1.0  # a conflict that has been gone for so long is over


class CarefulReflex:
    """When the careful driver began to brake; one for each episode."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._since_s: float | None = None
        self._last_s = 0.0

    def braking(self, frame: Frame, path: Path, seen: Bools) -> float:
        """How hard it brakes now, m/s²; 0 while it perceives no conflict.

        Args:
          frame: all actors now.
          path: the ego's way ahead, from its centre.
          seen: `n`, who of the frame is in its sight.
        """
        now = frame.time_s
        if conflicts_now(frame, path, seen, self._ground).any():
            self._since_s, self._last_s = (now if self._since_s is None else self._since_s), now
        elif self._since_s is not None and now - self._last_s > OVER_S:
            self._since_s = None
        if self._since_s is None or now - self._since_s < CAREFUL_PERCEIVES_S:
            return 0.0
        return careful(now - self._since_s - CAREFUL_PERCEIVES_S, self._ground.friction * GRAVITY_MPS2)
