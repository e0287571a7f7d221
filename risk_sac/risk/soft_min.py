"""The soft minimum (7) of the requirements' robustness."""

import math

from risk_sac.jit import compiled
from risk_sac.types import Floats


@compiled
def soft_min(robustness: Floats, beta: float) -> float:
    """Soft minimum of the requirements' robustness, ρ(Φ, s).

    ρ(Φ, s) = -(1/β) log Σ_i exp(-β ρ_i)                                             (7)

    Args:
      robustness: `M`, M ≥ 1, scaled; below 0 means violated.
      beta: sharpness β > 0; larger is closer to the true minimum.

    Returns:
      A value in [min_i ρ_i - log(M)/β, min_i ρ_i].

    Source: RISK-SAC, Sec. III-C.
    """
    least = robustness.min()  # taken out so that exp cannot overflow
    summed = 0.0
    for value in robustness:
        summed += math.exp(beta * (least - value))
    return float(least - math.log(summed) / beta)
