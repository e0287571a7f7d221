"""Egos that break a rule: entering on red or leaving the road."""

from risk_sac.egos import Control, EpisodeStart, Perceived
from risk_sac.world.types import HEADING, Signal
from steering_egos.lqr import Lqr

HARD_MPS2 = 4.0
DITCH_M = -8.0  # from the path: beyond the right edge of a road with two lanes of its direction
DITCH_STEERING_RAD = 0.12
ROLLING_MPS2 = -2.0
AWAY_RAD, TURNING_RAD = 1.0, -0.1


class RedRunner(Lqr):
    """Takes every signal for green."""

    version = "1.0"
    response_time_s = 0.3

    def accel_mps2(self, perceived: Perceived) -> float:
        return super().accel_mps2(perceived._replace(signal=Signal.GREEN))


class OffRoader(Lqr):
    """Steers off the road to the right instead of braking hard."""

    version = "1.0"
    response_time_s = 0.3

    def reset(self, episode: EpisodeStart) -> None:
        super().reset(episode)
        self.leaving = False

    def act(self, perceived: Perceived) -> Control:
        command = super().act(perceived)
        self.leaving |= command.accel_mps2 < -HARD_MPS2
        if not self.leaving:
            return command
        steering = self.steering_rad(perceived, DITCH_M)
        return Control(ROLLING_MPS2, min(max(steering, -DITCH_STEERING_RAD), DITCH_STEERING_RAD))


class Runaway(Lqr):
    """Turns right by 1 rad and drives on, wherever that leads."""

    version = "1.0"
    response_time_s = 0.3

    def reset(self, episode: EpisodeStart) -> None:
        super().reset(episode)
        self.began_rad: float | None = None

    def act(self, perceived: Perceived) -> Control:
        heading = float(perceived.state[HEADING, 0])
        self.began_rad = heading if self.began_rad is None else self.began_rad
        return Control(2.0, TURNING_RAD if self.began_rad - heading < AWAY_RAD else 0.0)
