"""Execution of runs and their records, in this or in separate processes."""

from typing import TYPE_CHECKING, Literal, get_args

from risk_sac.errors import ConfigError

if TYPE_CHECKING:
    from risk_sac.execution.executor import MakeExecutor

ExecutorName = Literal["local", "ray"]


def executor_named(name: str) -> "MakeExecutor":
    """Returns the factory of an executor.

    Raises:
      ConfigError: there is none of this name.
    """
    # Imported here: helper programs of this package need neither.
    if name == "local":
        from risk_sac.execution.local import LocalExecutor

        return LocalExecutor
    if name == "ray":
        from risk_sac.execution.ray.executor import RayExecutor

        return RayExecutor
    raise ConfigError("RISK_SAC_EXECUTOR", f"{name!r}", f"one of {', '.join(get_args(ExecutorName))}")
