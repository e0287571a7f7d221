"""Snapshot of a learner's policy that acts and explores without torch."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, Protocol

import numpy as np

from risk_sac.search.agents.controls import Held
from risk_sac.search.agents.transition import Transition
from risk_sac.search.frozen_policy import LOG_STD_HALF, LOG_STD_MIDDLE, FrozenPolicy, respond
from risk_sac.world.types import Floats, Vector

Exploration = float | Literal["squashed", "clipped"]
"""σ of the noise on an action, or how log σ follows from the network's further outputs."""
CLIPPED = -20.0, 2.0  # log σ of Stable-Baselines3's SAC


class Reflection(Protocol):
    """Mirror image of what is observed and done, see `risk_sac.search.prior.mirror`."""

    def observation(self, seen: Vector) -> Vector:
        """Returns what is observed in the mirrored scene."""

    def action(self, acted: Vector) -> Vector:
        """Returns the mirrored action."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicySnapshot:
    """Policy of a learner at one moment, and λ.

    Attributes:
      policy: its network, log σ among the outputs if the policy has one.
      exploration: how actions are drawn from the outputs.
      decision_steps: environment steps for which an action is held.
      random_steps: steps that are left of the warm-up, in which actions are uniformly random.
      dual_variable: λ.
      mirror: of a policy that sees every other episode mirrored.
    """

    policy: FrozenPolicy
    exploration: Exploration
    decision_steps: int
    random_steps: int
    dual_variable: float
    mirror: Reflection | None = None

    def state(self) -> dict[str, Any]:
        """Returns plain values of what learning changes."""
        return {
            "layers": list(self.policy.layers),
            "random_steps": self.random_steps,
            "dual_variable": self.dual_variable,
        }

    def at(self, state: dict[str, Any]) -> "PolicySnapshot":
        """Returns the same learner's policy at another moment, as `state` describes it."""
        policy = replace(self.policy, layers=tuple(state["layers"]))
        return replace(self, policy=policy, random_steps=state["random_steps"], dual_variable=state["dual_variable"])


def drawn_mirrored(random: np.random.Generator, mirror: Reflection | None) -> bool:
    """Draws whether an episode is mirrored; never without a mirror."""
    return mirror is not None and bool(random.integers(2))


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

    def __init__(self, snapshot: PolicySnapshot, seed: int) -> None:
        """Begins an episode; the seed is of all that it draws."""
        self._snapshot, self._held = snapshot, Held(snapshot.decision_steps)
        self._random = np.random.default_rng(seed)
        self._mirror = snapshot.mirror if drawn_mirrored(self._random, snapshot.mirror) else None
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
        policy, exploration = self._snapshot.policy, self._snapshot.exploration
        if explore and len(self.transitions) < self._snapshot.random_steps:
            return self._random.uniform(-1.0, 1.0, policy.action_size).astype(np.float32)
        seen = observation if self._mirror is None else self._mirror.observation(observation)
        if explore:
            outputs = respond(list(policy.layers), seen, normalised=policy.normalised)
            action = explored(outputs, exploration, self._random)
        else:
            action = policy(seen)
        return action if self._mirror is None else self._mirror.action(action)
