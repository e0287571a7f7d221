"""Counts the processes that play the episodes of a run."""

import logging

from risk_sac.config import RunSpec, method_of
from risk_sac.egos.registry import instances_of
from risk_sac.host.machine import rollout_processes

logger = logging.getLogger(__name__)


def most_processes(spec: RunSpec) -> int:
    """Returns how many processes can play a run at a time.

    These are as many as a round has episodes, but no more than its ego allows instances.

    Raises:
      ConfigError: the run's ego is not registered.
    """
    batch = spec.budget.batch if method_of(spec.method).in_rounds else 1
    return min(batch, instances_of(spec.ego) or batch)


def processes_of(spec: RunSpec) -> int:
    """Returns how many processes play a run; logs an ego's lower limit.

    Raises:
      ConfigError: the run's ego is not registered, or RISK_SAC_ROLLOUTS is no positive integer.
    """
    most, allowed = most_processes(spec), rollout_processes()
    if most < min(spec.budget.batch, allowed) and method_of(spec.method).in_rounds:
        message = "rounds of %d episodes are played by %d process(es): the ego %r allows no more instances"
        logger.warning(message, spec.budget.batch, most, spec.ego.driver)
    return min(most, allowed)
