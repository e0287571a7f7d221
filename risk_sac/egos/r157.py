"""The competent and careful human driver of UN Regulation 157, Annex 3: late by 1.15 s, and then braking in full."""

from risk_sac.egos.driving import Driver, needed_braking, time_to_collision
from risk_sac.egos.seam import Control, Episode, Perceived
from risk_sac.types import SPEED
from risk_sac.verdicts.along import LEADER_BRAKES_MPS2
from risk_sac.verdicts.course import HORIZON_S
from risk_sac.verdicts.drivers import R157_DELAY_S, R157_PERCEIVES_S, r157

HEADWAY_S = 2.0  # which the regulation's driver keeps
RISK_TTC_S = 2.0  # below which the regulation's driver perceives a risk
RISK_BRAKING_MPS2 = 3.4  # Choice: or where a gentle braking no longer does
OVER_S = 1.0  # a risk that has been gone for so long is over


class R157(Driver):
    """Follows by IDM and brakes as UN R157's human driver: 0.4 s to perceive, 0.75 s to respond, then 0.774 g."""

    version = "1.0"
    response_time_s = 1.15

    def reset(self, episode: Episode) -> None:
        """Begins an episode, without a risk."""
        super().reset(episode)
        self._since_s: float | None = None
        self._last_s = 0.0

    def act(self, perceived: Perceived) -> Control:
        """Follows, and brakes for what it has perceived as a risk long enough ago."""
        speed, now = float(perceived.state[SPEED, 0]), perceived.time_s
        ahead = self.ahead(perceived)
        if (
            time_to_collision(speed, ahead) <= RISK_TTC_S
            or needed_braking(speed, ahead) > RISK_BRAKING_MPS2
            or any(each.braking_mps2 > LEADER_BRAKES_MPS2 and each.gap_m < HORIZON_S * speed for each in ahead)
        ):
            self._since_s, self._last_s = (now if self._since_s is None else self._since_s), now
        elif self._since_s is not None and now - self._last_s > OVER_S:
            self._since_s = None
        accel = self.follow(perceived, ahead, HEADWAY_S)
        if self._since_s is not None:
            # Until it has perceived the risk, it drives on; what it then does is the regulation's.
            braked_s = now - self._since_s - R157_PERCEIVES_S
            reflex = r157(braked_s, self.vehicle.brake_mps2) if braked_s >= 0.0 else 0.0
            accel = min(max(accel, -RISK_BRAKING_MPS2), -reflex) if braked_s < R157_DELAY_S else min(accel, -reflex)
        return self.keeping_lane(perceived, accel)
