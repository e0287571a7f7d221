"""Which executors there are; `RISK_SAC_EXECUTOR` chooses one, for the service and for `risk-sac evaluate` alike."""

from collections.abc import Callable, Mapping
from typing import Any, Literal

from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Executor, Program
from risk_sac.execution.local import LocalExecutor

ExecutorName = Literal["local", "ray"]
MakeExecutor = Callable[[Program[Any]], Executor[Any]]


def _on_ray(program: Program[Any]) -> Executor[Any]:
    from risk_sac.execution.ray.executor import RayExecutor  # here: who does not want it does not load it

    return RayExecutor(program)


EXECUTORS: Mapping[ExecutorName, MakeExecutor] = {"local": LocalExecutor, "ray": _on_ray}


def executor_named(name: str) -> MakeExecutor:
    """What makes the executor of this name for one kind of worker.

    Raises:
      ConfigError: there is none of this name.
    """
    for known, make in EXECUTORS.items():
        if known == name:
            return make
    raise ConfigError("RISK_SAC_EXECUTOR", f"{name!r}", f"one of {', '.join(EXECUTORS)}")
