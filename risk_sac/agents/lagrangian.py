"""The step of the dual variable λ, which prices the realism cost.

Source: RISK-SAC, Sec. III-B, Eq. 1-2, and Alg. 1, l. 15-16.
"""

import math

from risk_sac.config.learner import LagrangianConfig
from risk_sac.errors import NotFinite


def dual_step(dual_variable: float, cost: float, config: LagrangianConfig) -> float:
    """One projected step of gradient ascent on the dual of (2).

    λ ← min([λ + η_λ (C_soft - d)]_+, λ_max)

    Deviation: the cost is that of the step just taken, where the paper takes the mean of a mini-batch. A replay's
    mean tells what the policies of the last 100,000 steps cost, and RPER's draws favour costly ones; λ is to follow
    the policy that acts now, and it averages over the last 1/η_λ steps by itself.

    Deviation: λ is capped at λ_max, which the paper does not do, so that a burst of cost cannot drown
    the risk reward for good.

    Args:
      dual_variable: λ ≥ 0.
      cost: C_soft of one step.
      config: η_λ, d and λ_max.

    Returns:
      The next λ, in [0, λ_max].

    Raises:
      NotFinite: the cost is NaN or infinite.

    Source: RISK-SAC, Alg. 1, l. 16.
    """
    if not math.isfinite(cost):
        raise NotFinite(f"realism cost is {cost}; wanted a finite number. Check C_soft.")
    ascended = dual_variable + config.learning_rate * (cost - config.cost_limit)
    return min(max(ascended, 0.0), config.maximum)
