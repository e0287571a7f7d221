"""A step of an episode, as an agent observes it."""

from dataclasses import dataclass

from risk_sac.world.types import Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Transition:
    """One step of an episode, with the parts of its reward apart."""

    observation: Vector
    action: Vector  # in [-1, 1]
    risk_reward: float  # R_risk(s, a)
    cost: float  # C_soft(s, a)
    robustness: float  # ρ(Φ, s)
    next_robustness: float  # ρ(Φ, s')
    next_observation: Vector
    terminated: bool  # the world ended; False where only the time limit did, so that s' is bootstrapped
    accumulated_reward: float  # R̂: the episode's reward up to and including this step
