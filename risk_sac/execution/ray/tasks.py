"""Functions as tasks of the cluster: each is handed to Ray once, is never repeated, and runs where it is wanted."""

from collections.abc import Callable
from functools import cache
from typing import Any

import ray
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from risk_sac.execution.ray.settings import RaySettings


def of_a_run(function: Callable[..., Any], settings: RaySettings, name: str) -> Any:
    """One that takes of its node what a run takes, and tells as it goes."""
    memory = {"memory": settings.ray_memory_bytes_per_run} if settings.ray_memory_bytes_per_run else {}
    return _remote(function).options(
        name=name,
        num_cpus=settings.ray_cpus_per_run,
        max_retries=0,
        num_returns="streaming",
        scheduling_strategy="SPREAD",
        **memory,
    )


def on_node(function: Callable[..., Any], node: str) -> Any:
    """One that a certain node executes at once, whatever else it is doing."""
    strategy = NodeAffinitySchedulingStrategy(node, soft=False)
    return _remote(function).options(num_cpus=0, max_retries=0, scheduling_strategy=strategy)


@cache  # Ray would store each of them anew in the head, and fetch it anew on every node
def _remote(function: Callable[..., Any]) -> Any:
    return ray.remote(function)
