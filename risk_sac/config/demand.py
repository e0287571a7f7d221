"""Estimates the memory that a run needs, before it begins."""

import math
from collections.abc import Sequence
from itertools import pairwise

from risk_sac.config.campaign import RunSpec
from risk_sac.config.methods import method_of
from risk_sac.errors import ConfigError

MOST_BYTES = 2 * 2**30  # of a run, beside the 0.6 GB or so that any run takes for code
FLOAT, DOUBLE = 4, 8
EPISODE_BYTES = 12_000  # of a record, as an object and as text in a checkpoint
IN_CHECKPOINT = 3  # what lives, its copy, and the archive of it


def check_demand(spec: RunSpec, observation_size: int, action_size: int, horizon_steps: int) -> None:
    """Refuses a run that takes more than `MOST_BYTES`; the ConfigError names the field that takes most of it."""
    demand = demand_bytes(spec, observation_size, action_size, horizon_steps)
    if (total := sum(demand.values())) > MOST_BYTES:
        field, most = max(demand.items(), key=lambda item: item[1])
        raise ConfigError(
            field,
            f"{_value(spec, field)}, for which a run takes {most / 2**30:.1f} GiB of memory, and "
            f"{total / 2**30:.1f} GiB in all",
            f"at most {MOST_BYTES / 2**30:g} GiB in all",
        )


def demand_bytes(spec: RunSpec, observation_size: int, action_size: int, horizon_steps: int) -> dict[str, int]:
    """Computes the memory at a run's fullest moment, by the field that asks for it.

    That is when a checkpoint is written at the run's end.

    parameters: P floats; of a network that learns 4 live (value, gradient, two moments of Adam) and 6 in a checkpoint
    (values and moments, copied and written), of a target 2 and 2.
    replay: a row for each decision of the search, up to the capacity, `IN_CHECKPOINT` times.
    batch: what enters and leaves each layer of four networks at once.
    """
    method, agent, episodes = method_of(spec.method), spec.learner.agent, spec.budget.episodes
    demand = {"budget.episodes": EPISODE_BYTES * spec.budget.total_episodes}
    if not method.learns:
        return demand
    stochastic = method.stochastic
    actor = (observation_size, *agent.hidden_sizes, action_size * (2 if stochastic else 1))
    critic = (observation_size + action_size, *agent.hidden_sizes, 1)
    critics, actor_targets = (2, 0) if stochastic else (1, 1)
    floats = (10 + 4 * actor_targets) * parameters(actor) + (10 + 4) * critics * parameters(critic)
    row = FLOAT * (2 * observation_size + action_size + 5) + (4 * DOUBLE if method.replay == "rper" else 0)
    decisions = min(spec.learner.replay.capacity, episodes * math.ceil(horizon_steps / agent.decision_steps))
    return demand | {
        "learner.agent.hidden_sizes": FLOAT * floats,
        "learner.replay.capacity": IN_CHECKPOINT * row * decisions,
        "learner.agent.batch_size": FLOAT * agent.batch_size * 4 * 2 * sum(critic),
    }


def parameters(sizes: Sequence[int]) -> int:
    """Weights and biases of a perceptron with layers of these sizes."""
    return sum((fan_in + 1) * out for fan_in, out in pairwise(sizes))


def _value(spec: RunSpec, field: str) -> object:
    value: object = spec
    for name in field.split("."):
        value = getattr(value, name)
    return list(value) if isinstance(value, tuple) else value
