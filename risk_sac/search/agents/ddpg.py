"""Deep deterministic policy gradient: SAC's losses without entropy, for a deterministic policy.

Source: Lillicrap et al., "Continuous control with deep reinforcement learning", 2016. Read beside `sac.py`.
"""

import copy

import torch
from torch import Tensor
from torch.optim import Adam

from risk_sac.config.learner import AgentConfig, DdpgConfig
from risk_sac.search.agents.agent import (
    Agent,
    UpdateResult,
    actor_weights,
    all_finite,
    critic_loss,
    follow,
    mean_magnitude,
    minimise,
    td_target,
)
from risk_sac.search.agents.networks import Mlp
from risk_sac.search.agents.replay import Batch
from risk_sac.search.agents.sac import actor_loss, values
from risk_sac.world.types import Vector


class DdpgAgent(Agent):
    """Policy and critic with targets; Gaussian noise explores.

    Choice: Gaussian noise instead of an Ornstein-Uhlenbeck process, which later work found to gain nothing.
    """

    exploration: float  # σ of the noise

    def __init__(
        self,
        observation_size: int,
        action_size: int,
        config: AgentConfig,
        ddpg: DdpgConfig,
        seed: int,
        device: str = "cpu",
    ) -> None:
        self._config = config
        self.exploration = ddpg.exploration_deviation
        self._action_size = action_size
        self._generator = torch.Generator(torch.device(device)).manual_seed(seed)
        critic_sizes = (observation_size + action_size, *config.hidden_sizes, 1)
        self._policy = Mlp((observation_size, *config.hidden_sizes, action_size), self._generator)
        self._critic = Mlp(critic_sizes, self._generator, normalised=True)
        self._target_policy, self._target_critic = copy.deepcopy((self._policy, self._critic))
        self._policy_optimizer = Adam(self._policy.parameters(), lr=config.actor_learning_rate, fused=True)
        self._critic_optimizer = Adam(self._critic.parameters(), lr=config.critic_learning_rate, fused=True)
        self.parts = {
            "policy": self._policy,
            "critic": self._critic,
            "target_policy": self._target_policy,
            "target_critic": self._target_critic,
            "policy_optimizer": self._policy_optimizer,
            "critic_optimizer": self._critic_optimizer,
        }

    def act(self, observation: Vector, explore: bool) -> Vector:
        """See `Agent.act`: the policy's action, with noise while exploring."""
        action = torch.tanh(self._policy.respond(observation))
        if explore:
            noise = torch.randn(self._action_size, generator=self._generator, device=self._generator.device)
            action = (action + self.exploration * noise.cpu()).clamp(-1.0, 1.0)
        return action.numpy()

    def update(self, batch: Batch, reward: Tensor) -> UpdateResult:
        """See `Agent.update`."""
        td_errors = self._td_errors(batch, reward)
        loss_q = critic_loss(td_errors, batch.weight, self._config.critic_loss)
        minimise(loss_q, self._critic_optimizer)

        action = torch.tanh(self._policy(batch.observation)[0])
        value = values(self._critic, batch.observation, action)[0]
        weight = actor_weights(batch, weighted=self._config.weighted_actor)
        loss_mu = actor_loss(value, weight)  # -E[w Q_ψ(s, μ_θ(s))], Eq. 6
        minimise(loss_mu, self._policy_optimizer)
        follow(self._target_critic, self._critic, self._config.target_rate)
        follow(self._target_policy, self._policy, self._config.target_rate)

        figures = torch.stack((loss_q, loss_mu)).tolist()
        return UpdateResult(mean_magnitude(td_errors.detach()), *all_finite(figures))

    @torch.no_grad()
    def _target(self, batch: Batch, reward: Tensor) -> Tensor:
        next_action = torch.tanh(self._target_policy(batch.next_observation)[0])
        next_value = values(self._target_critic, batch.next_observation, next_action)[0]
        # y = r + γ (1 - terminated) Q̄_ψ(s', μ̄_θ(s')), Alg. 1
        return td_target(reward, batch.terminated, next_value, self._config.discount)

    def _td_errors(self, batch: Batch, reward: Tensor) -> Tensor:
        return self._target(batch, reward) - values(self._critic, batch.observation, batch.action)
