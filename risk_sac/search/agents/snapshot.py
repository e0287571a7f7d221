"""Snapshot of a learner's policy that acts and explores without torch."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, Protocol

import numpy as np

from risk_sac.search.agents.controls import Held
from risk_sac.search.agents.transition import Transition
from risk_sac.search.frozen_policy import LOG_STD_HALF, LOG_STD_MIDDLE, FrozenPolicy, Layers, respond
from risk_sac.world.types import Floats, Vector

Exploration = float | Literal["squashed", "clipped"]
"""σ of the noise on an action, or how log σ follows from the network's further outputs."""
CLIPPED = -20.0, 2.0  # log σ of Stable-Baselines3's SAC


class Attacking(Protocol):
    """An episode as a policy of one adversary sees it, see `risk_sac.search.prior.attacker`."""

    def seen(self, observation: Vector, value: Callable[[Vector], float], explore: bool) -> Vector:
        """Returns the policy's input."""

    def acted(self, action: Vector) -> Vector:
        """Returns the joint action."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicySnapshot:
    """Policy of a learner at one moment, and λ.

    Attributes:
      policy: its network, log σ among the outputs if the policy has one.
      exploration: how actions are drawn from the outputs.
      decision_steps: environment steps for which an action is held.
      random_steps: steps that are left of the warm-up, in which actions are uniformly random.
      dual_variable: λ.
      critic: of a policy of one adversary, which it chooses; none of a joint policy.
    """

    policy: FrozenPolicy
    exploration: Exploration
    decision_steps: int
    random_steps: int
    dual_variable: float
    critic: Layers = ()

    def state(self) -> dict[str, Any]:
        """Returns plain values of what learning changes."""
        return {
            "layers": list(self.policy.layers),
            "critic": list(self.critic),
            "random_steps": self.random_steps,
            "dual_variable": self.dual_variable,
        }

    def at(self, state: dict[str, Any]) -> "PolicySnapshot":
        """Returns the same learner's policy at another moment, as `state` describes it."""
        policy = replace(self.policy, layers=tuple(state["layers"]))
        rest = {name: value for name, value in state.items() if name != "layers"}
        return replace(self, policy=policy, **rest)


def own_value(policy: FrozenPolicy, critic: Layers, seen: Vector) -> float:
    """Returns a critic's value of a policy's own action."""
    return float(respond(critic, np.concatenate((seen, policy(seen))), normalised=True)[0])


def explored(outputs: Vector, exploration: Exploration, random: np.random.Generator) -> Vector:
    """Draws an action in [-1, 1] from outputs, as its agent explores.

    a = tanh(μ + σ ε), or tanh(μ) + σ ε within the bounds where σ is a setting.
    """
    if isinstance(exploration, float):
        noise = random.standard_normal(len(outputs), np.float32)
        noisy: Vector = np.clip(np.tanh(outputs) + np.float32(exploration) * noise, -1.0, 1.0)
        return noisy
    mean, raw = np.split(outputs, 2)
    log_std = LOG_STD_HALF * np.tanh(raw) + LOG_STD_MIDDLE if exploration == "squashed" else np.clip(raw, *CLIPPED)
    action: Vector = np.tanh(mean + np.exp(log_std) * random.standard_normal(len(mean), np.float32)).astype(np.float32)
    return action


class SnapshotActor:
    """Plays an episode by a snapshot; keeps the steps for the learner."""

    can_stop_early = False

    def __init__(
        self,
        snapshot: PolicySnapshot,
        seed: int,
        begin: Callable[[np.random.Generator], Attacking] | None = None,
    ) -> None:
        """Begins an episode; the seed is of all that it draws. `begin` is for a policy of one adversary."""
        self._snapshot, self._held = snapshot, Held(snapshot.decision_steps)
        self._random = np.random.default_rng(seed)
        self._attack = begin and begin(self._random)
        self.transitions: list[Transition] = []

    @property
    def dual_variable(self) -> float:
        """λ of the snapshot."""
        return self._snapshot.dual_variable

    def begin(self, genes: Floats) -> None:
        """Has begun; there are no genes."""

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Returns an action in [-1, 1], held for `decision_steps`."""
        return self._held.act(partial(self._decide, observation, explore))

    def observe(self, transition: Transition, *, own: bool = True) -> None:
        """Keeps a step."""
        self.transitions.append(transition)

    def update(self) -> None:
        """Learns nothing: the learner does, at `tell`."""

    def _decide(self, observation: Vector, explore: bool) -> Vector:
        if self._attack is None:
            return self._drawn(observation, explore)
        value = partial(own_value, self._snapshot.policy, self._snapshot.critic)
        return self._attack.acted(self._drawn(self._attack.seen(observation, value, explore), explore))

    def _drawn(self, seen: Vector, explore: bool) -> Vector:
        policy, exploration = self._snapshot.policy, self._snapshot.exploration
        if explore and len(self.transitions) < self._snapshot.random_steps:
            return self._random.uniform(-1.0, 1.0, policy.action_size).astype(np.float32)
        if explore:
            outputs = respond(policy.layers, seen, normalised=policy.normalised)
            return explored(outputs, exploration, self._random)
        return policy(seen)
