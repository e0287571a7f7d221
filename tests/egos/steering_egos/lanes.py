"""Egos that change to the next lane on the left, and back."""

import math

from risk_sac.egos import EpisodeStart, Perceived
from steering_egos.lqr import Lqr

LANE_M = 3.3  # as wide as the lanes of the shipped nets
LEAVES_S, RETURNS_S = 2.0, 8.0  # after the ego takes over
ACROSS_MPS = 1.1  # three seconds to the next lane


class LaneChanger(Lqr):
    """Drives in the next lane on the left from 2 s on."""

    version = "1.0"
    response_time_s = 0.3

    returns_s = math.inf

    def reset(self, episode: EpisodeStart) -> None:
        super().reset(episode)
        self.steps, self.aside_now_m = 0, 0.0

    def aside_m(self, perceived: Perceived) -> float:
        left = LEAVES_S <= self.steps * self.step_s < self.returns_s
        most_m = ACROSS_MPS * self.step_s
        self.aside_now_m += min(max(LANE_M * left - self.aside_now_m, -most_m), most_m)
        self.steps += 1
        return self.aside_now_m


class Overtaker(LaneChanger):
    """Drives in the next left lane from 2 s to 8 s."""

    version = "1.0"
    response_time_s = 0.3

    returns_s = RETURNS_S
