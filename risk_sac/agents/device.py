"""Where the networks live."""

import logging
import time
from collections.abc import Callable

import numpy as np
import torch

from risk_sac.agents.agent import Agent
from risk_sac.agents.replay import Batch
from risk_sac.errors import ConfigError

logger = logging.getLogger(__name__)

TRIAL_UPDATES = 30  # timed after as many to warm up: about a second in all


def choose_device(wanted: str, make: Callable[[str], Agent], batch: Batch) -> str:
    """`wanted`, or where an update is faster if that is `auto`.

    Args:
      wanted: auto, cpu or cuda.
      make: an agent on the named device.
      batch: transitions to learn from.

    Raises:
      ConfigError: `cuda` is wanted and there is none.
    """
    if not torch.cuda.is_available():
        if wanted == "cuda":
            raise ConfigError("learner.agent.device", "'cuda', and torch sees no CUDA device here", "'auto' or 'cpu'")
        return "cpu"
    if wanted != "auto":
        return wanted
    seconds = {device: _seconds_per_update(make(device), batch.on(device)) for device in ("cpu", "cuda")}
    chosen = min(seconds, key=lambda device: seconds[device])
    logger.info("networks on %s: seconds per update are %s", chosen, seconds)
    return chosen


def random_batch(observation_size: int, action_size: int, rows: int) -> Batch:
    """Transitions made of noise, to time updates with."""
    generator = torch.Generator().manual_seed(0)

    def noise(*shape: int) -> torch.Tensor:
        return torch.rand(shape, generator=generator)

    return Batch(
        observation=noise(rows, observation_size),
        action=noise(rows, action_size),
        risk_reward=noise(rows),
        cost=noise(rows),
        robustness=noise(rows),
        next_robustness=noise(rows),
        next_observation=noise(rows, observation_size),
        terminated=noise(rows).round(),
        weight=noise(rows),
        indices=np.arange(rows),
    )


def _seconds_per_update(agent: Agent, batch: Batch) -> float:
    for _ in range(TRIAL_UPDATES):
        agent.update(batch, batch.risk_reward)
    started = time.perf_counter()
    for _ in range(TRIAL_UPDATES):
        agent.update(batch, batch.risk_reward)  # ends by reading the losses, so nothing is left in flight
    return (time.perf_counter() - started) / TRIAL_UPDATES
