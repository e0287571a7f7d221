"""RISK-SAC that starts from the pretrained policy and goes on learning by Algorithm 1."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from risk_sac.config.learner import LearnerConfig
from risk_sac.config.methods import Method
from risk_sac.env.problem import Problem
from risk_sac.search.agents.learner import Learner
from risk_sac.search.agents.snapshot import PolicySnapshot, own_value
from risk_sac.search.agents.transition import Transition
from risk_sac.search.frozen_policy import Layers, network
from risk_sac.search.prior.attacker import ACTION_SIZE, INPUT_SIZE, AttackerView
from risk_sac.search.prior.policy import PretrainedPolicy
from risk_sac.world.types import Vector

if TYPE_CHECKING:
    from risk_sac.search.agents.sac import SacAgent

FINE_TUNING = {
    "actor_learning_rate": 3e-4,
    "critic_learning_rate": 3e-4,
    "warmup_steps": 0,
    "updates_per_step": 0.14,  # fewer than one per decision, as in the pretraining
}
"""Settings of `learner.agent` in the place of the defaults for networks that begin from nothing."""


class PretrainedLearner(Learner):
    """Learner with pretrained networks, which drive one adversary of each episode."""

    def __init__(
        self, pretrained: PretrainedPolicy, problem: Problem, method: Method, config: LearnerConfig, seed: int
    ) -> None:
        """Takes over the networks; see `Learner`."""
        given = config.agent.model_fields_set
        changed: dict[str, Any] = {name: value for name, value in FINE_TUNING.items() if name not in given}
        hidden = tuple(weight.shape[-1] for weight in pretrained.policy[:-2:2])
        agent = config.agent.model_copy(update={**changed, "hidden_sizes": hidden})
        config = config.model_copy(update={"agent": agent})
        self._start, self._view = pretrained, AttackerView(problem)
        super().__init__(INPUT_SIZE, ACTION_SIZE, method, config, seed)

    def _begin(self, random: np.random.Generator) -> None:
        """See `Learner._begin`; draws what may decide the attacker."""
        super()._begin(random)
        self._attack = self._view.begin(random)

    def _decide(self, observation: Vector, explore: bool) -> Vector:
        return self._attack.acted(super()._decide(self._attack.seen(observation, self._value, explore), explore))

    def _seen(self, decided: Transition) -> Transition | None:
        return self._attack.transition(decided)

    def _taken(self) -> PolicySnapshot:
        return replace(super()._taken(), critic=self._critic)

    @property
    def _critic(self) -> Layers:
        """The first critic."""
        return network(cast("SacAgent", self._agent).networks()[1])

    def _value(self, seen: Vector) -> float:
        return own_value(self.frozen(), self._critic, seen)

    def _make_agent(self, observation_size: int, action_size: int, seed: int) -> "SacAgent":
        from risk_sac.search.agents.sac import SacAgent  # here, because of torch

        agent, sac = self._config.agent, self._config.sac
        made = SacAgent(observation_size, action_size, agent, sac, seed, self.device, normalised=True)
        made.begin_from(self._start.policy, self._start.critics, self._start.temperature)
        return made
