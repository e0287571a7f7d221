"""Stable-Baselines3's SAC in place of ours, a control for our learner.

Memory, warm start and pace stay the learner's, and so do widths, batch and rates, so that two rows differ in the update
alone. SB3 has one learning rate for all networks; it gets the actor's, which is also its default. It stays on the
processor: of a GPU's generator it would draw unseeded.
"""

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, cast

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from torch import Tensor
from torch.nn import Linear

from risk_sac.config.learner import AgentConfig, SacConfig
from risk_sac.errors import NotFinite
from risk_sac.search.agents.agent import UpdateResult, all_finite, loading
from risk_sac.search.agents.replay import Batch
from risk_sac.search.agents.snapshot import Exploration
from risk_sac.search.frozen_policy import FrozenPolicy
from risk_sac.world.types import Floats, Vector


class SpacesOnly(gym.Env[Vector, Vector]):
    """Spaces from which a model is built; it is never stepped."""

    def __init__(self, observation_size: int, action_size: int) -> None:
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (observation_size,), np.float32)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (action_size,), np.float32)


class _Given(NamedTuple):
    """A buffer that has one batch to give."""

    samples: ReplayBufferSamples

    def sample(self, batch_size: int, env: object = None) -> ReplayBufferSamples:
        return self.samples


class Sb3Agent:
    """`stable_baselines3.SAC` on batches given to it, without weights or TD errors."""

    exploration: Exploration = "clipped"

    def __init__(self, observation_size: int, action_size: int, config: AgentConfig, sac: SacConfig, seed: int) -> None:
        self._generator = torch.Generator().manual_seed(seed).get_state()
        with self._noise():
            self._model = SAC(
                "MlpPolicy",
                SpacesOnly(observation_size, action_size),
                learning_rate=config.actor_learning_rate,
                buffer_size=1,
                batch_size=config.batch_size,
                tau=config.target_rate,
                gamma=config.discount,
                ent_coef=f"auto_{sac.initial_temperature}",
                target_entropy=sac.target_entropy_per_action * action_size,
                policy_kwargs={"net_arch": list(config.hidden_sizes)},
                device="cpu",
            )
        self._model.set_logger(Logger(None, []))
        self._log_temperature = cast(Tensor, self._model.log_ent_coef)

    @contextmanager
    def _noise(self) -> Iterator[None]:
        """SB3 draws from torch's global generator; meanwhile that is this agent's own."""
        with torch.random.fork_rng(devices=[]):
            torch.set_rng_state(self._generator)
            yield
            self._generator = torch.get_rng_state()

    @property
    def temperature(self) -> float:
        """α."""
        return self._log_temperature.exp().item()

    def act(self, observation: Vector, explore: bool) -> Vector:
        """See `Agent.act`."""
        with self._noise():
            action, _ = self._model.predict(observation, deterministic=not explore)
        return action

    def frozen(self) -> FrozenPolicy:
        """See `Agent.frozen`."""
        layers = (layer for layer in self._model.policy.actor.modules() if isinstance(layer, Linear))
        *hidden, mean, log_std = ((layer.weight.t().detach().numpy(), layer.bias.detach().numpy()) for layer in layers)
        last = [np.concatenate(pair, axis=-1) for pair in zip(mean, log_std, strict=True)]
        return FrozenPolicy((*(array.copy() for pair in hidden for array in pair), *last), len(mean[1]))

    def td_errors(self, batch: Batch, reward: Tensor) -> Floats:
        """Nothing is replayed by them."""
        return np.zeros(len(reward))

    def update(self, batch: Batch, reward: Tensor) -> UpdateResult:
        """See `Agent.update`; SB3 tells no entropy."""
        samples = ReplayBufferSamples(
            observations=batch.observation,
            actions=batch.action,
            next_observations=batch.next_observation,
            dones=batch.terminated[:, None],
            rewards=reward[:, None],
        )
        self._model.replay_buffer = cast(ReplayBuffer, _Given(samples))
        try:
            with self._noise():
                self._model.train(gradient_steps=1, batch_size=len(reward))
        except ValueError as error:  # what torch's distributions say of a mean that is NaN
            raise NotFinite(f"an update of SB3's SAC failed: {error}") from error
        told = self._model.logger.name_to_value
        critic_loss, actor_loss, temperature = all_finite(
            [told["train/critic_loss"], told["train/actor_loss"], self.temperature]
        )
        return UpdateResult(np.zeros(len(reward)), critic_loss, actor_loss, temperature)

    def state(self) -> dict[str, Any]:
        """See `Agent.state`."""
        return copy.deepcopy(
            {
                "parameters": self._model.get_parameters(),
                "log_temperature": self._log_temperature.detach(),
                "generator": self._generator,
            }
        )

    def load(self, state: dict[str, Any]) -> None:
        """See `Agent.load`."""
        with loading():
            self._model.set_parameters(copy.deepcopy(state["parameters"]))
            self._log_temperature.data.copy_(state["log_temperature"])
            self._generator = torch.Generator().set_state(state["generator"]).get_state()
