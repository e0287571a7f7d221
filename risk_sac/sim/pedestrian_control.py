"""From an action to a pedestrian's next state."""

import math
from dataclasses import dataclass

from risk_sac.scenario.limits import Limits
from risk_sac.sim.sumo import Walker
from risk_sac.sim.taper import clip, taper
from risk_sac.types import STEP_S


@dataclass(slots=True)
class PedestrianControl:
    """Integrates a pedestrian's motion; along and across its heading it accelerates on a disc.

    Source: that heading rate falls with about 1/speed, Wang et al., A kinematic constraint on pedestrian walking
    (arXiv 2506.15321).
    """

    limits: Limits
    state: Walker
    across_mps2: float = 0.0

    def step(self, drive: float, turn: float) -> Walker:
        """One step of 0.1 s.

        Args:
          drive: acceleration as a share of the limit, -1 to 1.
          turn: heading rate as a share of what the speed allows, -1 (clockwise) to 1.
        """
        limits, state = self.limits, self.state
        accel, self.across_mps2 = self._accelerate(drive, turn)
        speed = clip(state.speed_mps + accel * STEP_S, 0.0, limits.walk_speed_mps)
        disc = limits.walk_disc_mps2
        rate = self.across_mps2 / max(state.speed_mps, speed, disc / limits.heading_rate_radps)
        turned = rate * STEP_S
        distance, middle = (state.speed_mps + speed) / 2 * STEP_S, state.heading_rad + turned / 2
        self.state = Walker(
            x_m=state.x_m + distance * math.cos(middle),
            y_m=state.y_m + distance * math.sin(middle),
            heading_rad=state.heading_rad + turned,
            speed_mps=speed,
            accel_mps2=(speed - state.speed_mps) / STEP_S,
        )
        return self.state

    def _accelerate(self, drive: float, turn: float) -> tuple[float, float]:
        """Acceleration along and across: towards what is wanted on the disc, by at most the jerk."""
        limits, along, across = self.limits, self.state.accel_mps2, self.across_mps2
        jerk = limits.walk_jerk_mps3
        low = -taper(self.state.speed_mps, jerk)
        high = taper(limits.walk_speed_mps - self.state.speed_mps, jerk)
        wanted = drive * (limits.walk_accel_mps2 if drive >= 0 else limits.walk_brake_mps2)
        to_along, to_across = clip(wanted, low, high), turn * limits.walk_disc_mps2
        too_much = max(math.hypot(to_along, to_across) / limits.walk_disc_mps2, 1.0)
        to_along, to_across = to_along / too_much - along, to_across / too_much - across
        share = min(jerk * STEP_S / max(math.hypot(to_along, to_across), 1e-9), 1.0)
        # The disc is convex, and the taper only takes acceleration away: nothing leads out of it.
        return clip(along + share * to_along, low, high), across + share * to_across
