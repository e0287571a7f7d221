"""RISK-SAC that starts from the pretrained policy and goes on learning by Algorithm 1."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from risk_sac.config.learner import LearnerConfig
from risk_sac.config.methods import Method
from risk_sac.search.agents.learner import Learner
from risk_sac.search.agents.snapshot import PolicySnapshot, drawn_mirrored
from risk_sac.search.agents.transition import Transition
from risk_sac.search.prior.mirror import Mirror
from risk_sac.search.prior.policy import Folded, PolicyLayout, PretrainedPolicy
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
    """Learner with pretrained networks.

    Choice: where the ego has a neighbour on either side, the networks see every other episode in the mirror, by a
    coin. They act there and learn from it there, because what they were trained on favours one side.
    """

    def __init__(
        self, pretrained: PretrainedPolicy, layout: PolicyLayout, method: Method, config: LearnerConfig, seed: int
    ) -> None:
        """Takes over the networks; see `Learner`."""
        start = Folded.of(pretrained, layout)
        given = config.agent.model_fields_set
        changed: dict[str, Any] = {name: value for name, value in FINE_TUNING.items() if name not in given}
        hidden = tuple(weight.shape[-1] for weight in start.policy[:-2:2])
        agent = config.agent.model_copy(update={**changed, "hidden_sizes": hidden})
        config = config.model_copy(update={"agent": agent})
        self._start = start
        self._mirror, self._reflected = Mirror.of(layout), False
        super().__init__(layout.observation_size, layout.action_size, method, config, seed)

    def _begin(self, random: np.random.Generator) -> None:
        """See `Learner._begin`; draws whether the episode is mirrored."""
        super()._begin(random)
        self._reflected = drawn_mirrored(random, self._mirror)

    def _seen(self, transition: Transition) -> Transition:
        return self._mirror.transition(transition) if self._mirror and self._reflected else transition

    def _taken(self) -> PolicySnapshot:
        return replace(super()._taken(), mirror=self._mirror)

    def _make_agent(self, observation_size: int, action_size: int, seed: int) -> "SacAgent":
        from risk_sac.search.agents.sac import SacAgent  # here, because of torch

        agent, sac = self._config.agent, self._config.sac
        made = SacAgent(observation_size, action_size, agent, sac, seed, self.device, normalised=True)
        made.begin_from(self._start.policy, self._start.critics, self._start.temperature)
        return made

    def _drawn(self, observation: Vector, explore: bool) -> Vector:
        agent = cast("SacAgent", self._agent)
        mirror = self._mirror if self._reflected else None
        seen = observation if mirror is None else mirror.observation(observation)
        action = agent.act(seen, explore)
        return action if mirror is None else mirror.action(action)
