"""An adaptive cruise control with the emergency braking of UN Regulation 152."""

from risk_sac.egos.driving import Driver, needed_braking, time_to_collision
from risk_sac.egos.seam import Control, Episode, Perceived
from risk_sac.types import SPEED

CRUISE_MPS2 = 3.5  # what ISO 15622 lets a cruise control brake with
HEADWAY_S = 1.5
WARNING_S = 0.8  # the regulation's warning before the emergency braking,
WARN_TTC_S, WARN_MPS2 = 2.6, 3.0
AT_ONCE_MPS2 = 5.0  # which is left out where the danger could not be seen coming
AEB_MPS2 = 7.0  # Choice: the regulation asks for 5 or more; cars on sale do about 7


class IdmAeb(Driver):
    """Follows by IDM with a cruise control's braking; in an emergency it warns for 0.8 s, then brakes by 7 m/s².

    What it could not warn of it brakes for at once.
    """

    version = "1.0"
    response_time_s = 0.8

    def reset(self, episode: Episode) -> None:
        """Begins an episode, without a warning."""
        super().reset(episode)
        self._warned_s: float | None = None

    def act(self, perceived: Perceived) -> Control:
        """Follows, warns, brakes."""
        speed, now = float(perceived.state[SPEED, 0]), perceived.time_s
        ahead = self.ahead(perceived)
        needed_mps2 = needed_braking(speed, ahead)
        if time_to_collision(speed, ahead) < WARN_TTC_S or needed_mps2 > WARN_MPS2:
            self._warned_s = now if self._warned_s is None else self._warned_s
        else:
            self._warned_s = None
        accel = max(self.follow(perceived, ahead, HEADWAY_S), -CRUISE_MPS2)
        warned = self._warned_s is not None and now - self._warned_s >= WARNING_S
        if needed_mps2 > AT_ONCE_MPS2 or (warned and needed_mps2 > WARN_MPS2):
            accel = min(accel, -AEB_MPS2)
        return self.keeping_lane(perceived, accel)
