"""Adaptive stress testing with Stable-Baselines3's agents, to compare a search with.

The adversaries' policy learns from nothing, on scenes that are drawn without a model. All settings are SB3's defaults.

R = -C_soft in each step; at the end of an episode without a failure, less the margin to one.

Source: Lee et al. 2020, "Adaptive Stress Testing: Finding Likely Failure Events with Reinforcement Learning", JAIR 69.
Choice: C_soft stands for the negative log-likelihood, and the soft minimum of robustness for the distance.
"""

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.logger import Logger

from risk_sac.errors import NotFinite
from risk_sac.records import DrivenBy
from risk_sac.search.agents.controls import NonLearner
from risk_sac.search.agents.sb3 import SpacesOnly
from risk_sac.search.agents.transition import Transition
from risk_sac.world.types import Floats, Vector

MARGIN_WEIGHT, MOST_MARGIN = 10.0, 1.0  # of the least robustness of an episode, in scales
SAC_CAPACITY = 100_000  # Deviation: SB3's default of a million does not fit into a checkpoint
SAC_ARRAYS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
PPO_ARRAYS = ("observations", "actions", "rewards", "episode_starts", "values", "log_probs")


class StressAgent(NonLearner, ABC):
    """Policy of all adversaries that minimises the least margin of an episode."""

    driven_by = DrivenBy.POLICY
    arrays: tuple[str, ...]

    def __init__(self, action_size: int, seed: int) -> None:
        self._action_size, self._model = action_size, None
        self._torch, self._numpy = torch.Generator().manual_seed(seed).get_state(), np.random.RandomState(seed)
        self._last: tuple[Transition, Any] | None = None  # not known yet whether it ends its episode
        self._told: Any = None  # what the model says beside its action
        self._least, self._starts = MOST_MARGIN, True

    def begin(self, genes: Floats) -> None:
        """Ends the episode before, if its horizon did."""
        self._flush(ended=True)

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Returns the joint action."""
        with self._noise():
            self._model = self._model or self._make(SpacesOnly(len(observation), self._action_size))
            action, self._told = self._decide(observation, explore)
        return np.clip(action, -1.0, 1.0).astype(np.float32)

    def observe(self, transition: Transition, *, own: bool = True) -> None:
        """Takes a step, and learns from the one before."""
        self._flush(ended=False)
        self._last = transition, self._told
        self._least = min(self._least, transition.next_robustness)
        if transition.terminated:
            self._flush(ended=True)

    def state(self) -> dict[str, Any]:
        """Returns the state that the next episode depends on."""
        self._flush(ended=True)
        if self._model is None:
            return {}
        buffer = self._buffer
        size = SAC_CAPACITY if buffer.full else buffer.pos
        return {
            "observation_size": self._model.observation_space.shape[0],
            "parameters": copy.deepcopy(self._model.get_parameters()),
            "arrays": {name: getattr(buffer, name)[:size].copy() for name in self.arrays},
            "buffer": (buffer.pos, buffer.full),
            "torch": self._torch,
            "numpy": self._numpy.get_state(legacy=False),
            "updates": self._model._n_updates,
            "log_temperature": self._temperature.detach().clone(),
        }

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""
        if not state:
            return
        with self._noise():
            self._model = self._make(SpacesOnly(state["observation_size"], self._action_size))
        self._model.set_parameters(copy.deepcopy(state["parameters"]))
        for name, values in state["arrays"].items():
            getattr(self._buffer, name)[: len(values)] = values
        self._buffer.pos, self._buffer.full = state["buffer"]
        self._temperature.data.copy_(state["log_temperature"])
        self._torch = state["torch"]
        self._numpy.set_state(state["numpy"])
        self._model._n_updates = state["updates"]

    def _flush(self, *, ended: bool) -> None:
        if self._last is None:
            return
        (transition, told), self._last = self._last, None
        reward = -transition.cost
        if ended:
            reward -= MARGIN_WEIGHT * max(self._least, 0.0)
        try:
            with self._noise():
                self._learn(transition, told, reward, ended)
        except ValueError as error:  # what torch's distributions say of a mean that is NaN
            raise NotFinite(f"an update of SB3 failed: {error}") from error
        self._starts = ended
        if ended:
            self._least = MOST_MARGIN

    @contextmanager
    def _noise(self) -> Iterator[None]:
        """SB3 draws from the global generators; meanwhile these are this agent's own."""
        before = np.random.get_state()  # noqa: NPY002
        with torch.random.fork_rng(devices=[]):
            torch.set_rng_state(self._torch)
            np.random.set_state(self._numpy.get_state())  # noqa: NPY002
            try:
                yield
            finally:
                self._torch = torch.get_rng_state()
                self._numpy.set_state(np.random.get_state())  # noqa: NPY002
                np.random.set_state(before)  # noqa: NPY002

    _model: Any

    @property
    def _temperature(self) -> torch.Tensor:
        """SB3's log α, which its parameters lack; nothing of PPO."""
        return getattr(self._model, "log_ent_coef", torch.zeros(1))

    @property
    @abstractmethod
    def _buffer(self) -> Any:
        """SB3's memory."""

    @abstractmethod
    def _make(self, spaces: SpacesOnly) -> Any:
        """Returns a new model."""

    @abstractmethod
    def _decide(self, observation: Vector, explore: bool) -> tuple[Floats | Vector, Any]:
        """Returns an action, and what else `_learn` takes."""

    @abstractmethod
    def _learn(self, transition: Transition, told: Any, reward: float, ended: bool) -> None:
        """Takes a step with its reward."""


class StressSac(StressAgent):
    """SB3's SAC: an update of the networks in each step."""

    arrays = SAC_ARRAYS

    @property
    def _buffer(self) -> Any:
        return self._model.replay_buffer

    def _make(self, spaces: SpacesOnly) -> SAC:
        model = SAC("MlpPolicy", spaces, buffer_size=SAC_CAPACITY, device="cpu")
        model.set_logger(Logger(None, []))
        return model

    def _decide(self, observation: Vector, explore: bool) -> tuple[Floats | Vector, Any]:
        if explore and not self._buffer.full and self._buffer.pos < self._model.learning_starts:
            return np.random.uniform(-1.0, 1.0, self._action_size), None  # noqa: NPY002
        return self._model.predict(observation, deterministic=not explore)[0], None

    def _learn(self, transition: Transition, told: Any, reward: float, ended: bool) -> None:
        t = transition
        done = np.array([ended])
        self._buffer.add(t.observation, t.next_observation, t.action, np.array([reward]), done, [{}])
        if self._buffer.full or self._buffer.pos > self._model.learning_starts:
            self._model.train(gradient_steps=1, batch_size=self._model.batch_size)


class StressPpo(StressAgent):
    """SB3's PPO: ten epochs after each 2,048 steps."""

    arrays = PPO_ARRAYS

    @property
    def _buffer(self) -> Any:
        return self._model.rollout_buffer

    def _make(self, spaces: SpacesOnly) -> PPO:
        model = PPO("MlpPolicy", spaces, device="cpu")
        model.set_logger(Logger(None, []))
        return model

    def _decide(self, observation: Vector, explore: bool) -> tuple[Floats | Vector, Any]:
        with torch.no_grad():
            action, value, log_prob = self._model.policy(torch.as_tensor(observation)[None], deterministic=not explore)
        return action[0].numpy(), (action.numpy(), value, log_prob)

    def _learn(self, transition: Transition, told: Any, reward: float, ended: bool) -> None:
        action, value, log_prob = told
        starts = np.array([self._starts])
        self._buffer.add(transition.observation[None], action, np.array([reward]), starts, value, log_prob)
        if self._buffer.full:
            with torch.no_grad():
                last = self._model.policy.predict_values(torch.as_tensor(transition.next_observation)[None])
            self._buffer.compute_returns_and_advantage(last, np.array([ended]))
            self._model.train()
            self._buffer.reset()
