"""Learner between environment steps, with the dual variable λ of realism.

Source: RISK-SAC, Sec. III-B, Eq. 1-2, and Alg. 1, l. 15-16.
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from risk_sac.config.learner import LagrangianConfig, LearnerConfig
from risk_sac.config.methods import Method
from risk_sac.env.problem import check_installed
from risk_sac.errors import NotFinite
from risk_sac.records import DrivenBy
from risk_sac.risk.reward import TrainingReward
from risk_sac.search.agents.controls import Decision, Held
from risk_sac.search.agents.snapshot import PolicySnapshot
from risk_sac.search.agents.transition import Transition
from risk_sac.search.frozen_policy import FrozenPolicy
from risk_sac.world.types import Floats, Vector

if TYPE_CHECKING:
    from torch import Tensor

    from risk_sac.search.agents.agent import Agent, UpdateResult
    from risk_sac.search.agents.replay import Batch
    from risk_sac.search.agents.sb3 import Sb3Agent


def dual_step(dual_variable: float, cost: float, config: LagrangianConfig) -> float:
    """One projected step of gradient ascent on the dual of (2).

    λ ← min([λ + η_λ (C_soft - d)]_+, λ_max)

    Deviation: the cost is that of the step just taken, where the paper takes the mean of a mini-batch. A replay's
    mean tells what the policies of the last 100,000 steps cost, and RPER's draws favour costly ones; λ is to follow
    the policy that acts now, and it averages over the last 1/η_λ steps by itself.

    Deviation: λ is capped at λ_max, which the paper does not do, so that it stays finite where no policy keeps d.

    Args:
      dual_variable: λ ≥ 0.
      cost: C_soft of one step.
      config: η_λ, d and λ_max.

    Returns:
      The next λ, in [0, λ_max].

    Raises:
      NotFinite: the cost is NaN or infinite.

    Source: RISK-SAC, Alg. 1, l. 16.
    """
    if not math.isfinite(cost):
        raise NotFinite(f"realism cost is {cost}; wanted a finite number. Check C_soft.")
    ascended = dual_variable + config.learning_rate * (cost - config.cost_limit)
    return min(max(ascended, 0.0), config.maximum)


class Learner:
    """Learner that acts, stores and trains between environment steps.

    It reads all settings of the method but the scene sampler.

    Attributes:
      device: where the networks live.
      dual_variable: λ; stays 0 where the method has no constraint.
    """

    genes = 0
    can_stop_early = False

    def __init__(
        self, observation_size: int, action_size: int, method: Method, config: LearnerConfig, seed: int
    ) -> None:
        """Draws the networks.

        Raises:
          ConfigError: the device that `config` names is not there.
        """
        # Here, like the agents below, because a search without a learner needs no torch.
        from risk_sac.search.agents.agent import check_device
        from risk_sac.search.agents.replay import RiskPrioritizedReplay, UniformReplay

        steps, discount = config.agent.decision_steps, config.agent.discount
        self._held, self._decision = Held(steps), Decision(steps, discount)
        config = config.model_copy(update={"agent": config.agent.model_copy(update={"discount": discount**steps})})
        self._method = method
        self._config = config  # with the γ of a decision
        self._reward = TrainingReward(method, config)
        self._action_size = action_size
        self.device = "cuda" if config.agent.device == "cuda" and method.agent != "sb3" else "cpu"
        check_device("learner.agent.device", self.device)
        sizes = observation_size, action_size
        self._agent = self._make_agent(*sizes, seed)
        replay = RiskPrioritizedReplay if method.replay == "rper" else UniformReplay
        self._replay = replay(*sizes, config.replay)
        self.dual_variable = min(config.lagrangian.initial, config.lagrangian.maximum) if method.lagrangian else 0.0
        self._generator = np.random.default_rng(seed)
        self._snapshot: PolicySnapshot | None = None  # of the policy as it is, once asked for
        self._acted = False
        self._steps, self._updates = 0, 0  # steps: its own, and those of others before the first of them

    @property
    def temperature(self) -> float:
        """α."""
        return self._agent.temperature

    @property
    def driven_by(self) -> DrivenBy:
        """Driver of the next action while exploring.

        The frozen policy always acts itself.
        """
        return DrivenBy.RANDOM if self._steps < self._config.agent.warmup_steps else DrivenBy.POLICY

    def begin(self, genes: Floats) -> None:
        """Begins an episode, for any driver; there are no genes."""
        self._begin(self._generator)

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Returns an action in [-1, 1], `action_size`, held for `decision_steps`.

        It is uniformly random in the first `warmup_steps`.
        """
        return self._held.act(partial(self._decide, observation, explore))

    def frozen(self) -> FrozenPolicy:
        """The policy as it is now, without exploration."""
        return self._agent.frozen()

    def snapshot(self) -> PolicySnapshot:
        """Returns the current policy for other processes; unchanged until `learn` or `load`."""
        if self._snapshot is None:
            self._snapshot = self._taken()
        return self._snapshot

    def learn(self, transitions: Sequence[Transition], snapshot: PolicySnapshot, seed: int, *, own: bool) -> None:
        """Learns from an episode of another process as from its own.

        Deviation: the policy, and λ in R̂, are those of the snapshot, which knows nothing of the two rounds before.

        Args:
          transitions: its steps.
          snapshot: what it was played with.
          seed: of the episode's `SnapshotActor`.
          own: whether the policy acted, and no other driver.
        """
        self._begin(np.random.default_rng(seed))
        for step, transition in enumerate(transitions):
            self._take(transition, own=own, priced=own and step >= snapshot.random_steps)
            if own:
                self.update()
        self._snapshot = None

    def observe(self, transition: Transition, *, own: bool = True) -> None:
        """Stores a step, and prices its cost if it is the policy's.

        The costs of the warm-up's actions are not priced.

        Args:
          transition: the step.
          own: whether this learner acted, and no other driver.
        """
        self._take(transition, own=own, priced=own and self.driven_by is DrivenBy.POLICY)

    def _take(self, transition: Transition, *, own: bool, priced: bool) -> None:
        self._acted |= own
        self._steps += own or not self._acted
        if self._method.lagrangian and priced:
            self.dual_variable = dual_step(self.dual_variable, transition.cost, self._config.lagrangian)  # l. 15-16
        decided = self._decision.add(transition)
        seen = None if decided is None else self._seen(decided)
        if seen is not None:
            self._replay.add(seen)  # Alg. 1, l. 12

    def update(self) -> "UpdateResult | None":
        """Learns from memory at `updates_per_step`; None in the warm-up and between updates.

        What the warm-up left undone is made up for, a step's share and at least one update at a time; so it never is if
        the pace is a whole number. Choice: what others do between its own episodes is learnt from, but calls for no
        further update; else a policy that takes turns would pay for all of them.

        Raises:
          NotFinite: learning has diverged.
        """
        result = None
        if self._steps >= self._config.agent.warmup_steps and len(self._replay):
            pace = self._config.agent.updates_per_step
            due = math.floor(pace * self._steps) - self._updates
            for _ in range(min(due, max(1, math.ceil(pace)))):
                self._updates += 1
                result = self._update_once()
        return result

    def state(self) -> dict[str, Any]:
        """Returns what the next episode depends on: tensors, arrays and plain values."""
        return {
            "agent": self._agent.state(),
            "replay": self._replay.state(),
            "dual_variable": self.dual_variable,
            "generator": self._generator.bit_generator.state,
            "acted": self._acted,
            "steps": self._steps,
            "updates": self._updates,
        }

    def load(self, state: dict[str, Any]) -> None:
        """Continue from `state()`, as if never interrupted.

        Raises:
          CheckpointError: the state is of another shape.
        """
        self._replay.load(state["replay"])
        self._agent.load(state["agent"])
        self.dual_variable = state["dual_variable"]
        self._generator.bit_generator.state = state["generator"]
        self._acted, self._steps, self._updates = state["acted"], state["steps"], state["updates"]
        self._snapshot = None

    def _begin(self, random: np.random.Generator) -> None:
        """Begins an episode; `random` is of what it draws at its start."""
        self._held.begin()
        self._decision.begin()

    def _seen(self, decided: Transition) -> Transition | None:
        """Returns a decision as the networks see it; None: they do not."""
        return decided

    def _taken(self) -> PolicySnapshot:
        """Takes a snapshot."""
        return PolicySnapshot(
            policy=self._agent.frozen(),
            exploration=self._agent.exploration,
            decision_steps=self._config.agent.decision_steps,
            random_steps=max(0, self._config.agent.warmup_steps - self._steps),
            dual_variable=self.dual_variable,
        )

    def _decide(self, observation: Vector, explore: bool) -> Vector:
        if explore and self.driven_by is DrivenBy.RANDOM:
            return self._generator.uniform(-1.0, 1.0, self._action_size).astype(np.float32)
        return self._agent.act(observation, explore)  # Alg. 1, l. 7

    def _make_agent(self, observation_size: int, action_size: int, seed: int) -> "Agent | Sb3Agent":
        sizes, config = (observation_size, action_size), self._config
        if self._method.agent == "ddpg":
            from risk_sac.search.agents.ddpg import DdpgAgent

            return DdpgAgent(*sizes, config.agent, config.ddpg, seed, self.device)
        if self._method.agent == "sac":
            from risk_sac.search.agents.sac import SacAgent

            return SacAgent(*sizes, config.agent, config.sac, seed, self.device)
        check_installed("sb3-sac")
        from risk_sac.search.agents.sb3 import Sb3Agent  # here, because it is an extra

        return Sb3Agent(*sizes, config.agent, config.sac, seed)

    def _update_once(self) -> "UpdateResult":
        batch_size = self._config.agent.batch_size
        while (new := self._replay.take_unmeasured(batch_size)) is not None:
            new = new.on(self.device)
            self._replay.update(new.indices, self._agent.td_errors(new, self._shaped(new)))  # Alg. 1, l. 11
        batch = self._replay.sample(batch_size, self._generator).on(self.device)  # Alg. 1, l. 13
        result = self._agent.update(batch, self._shaped(batch))  # Alg. 1, l. 14
        self._replay.update(batch.indices, result.td_errors)
        return result

    def _shaped(self, batch: "Batch") -> "Tensor":
        """R' of transitions (Alg. 1, l. 9-10), `n`.

        Deviation: formed when sampled, so λ is today's and not the one in force when the step was taken.
        """
        b = batch
        return self._reward(b.risk_reward, b.cost, b.robustness, b.next_robustness, b.terminated, self.dual_variable)
