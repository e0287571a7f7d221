"""The objective of the scene search, Eq. 11, and the running maximum it is measured against.

Source: RISK-SAC, Sec. III-E.
"""

from typing import NamedTuple, overload

import numpy as np

from risk_sac.types import Floats

# Choice: the paper leaves ε open. Mean returns per step are of order 0.1, so 1e-3 is negligible there and keeps f
# readable while M̄ passes through zero.
EPSILON = 1e-3


class RunningMaximum(NamedTuple):
    """Largest mean return so far, raw and smoothed."""

    largest: float  # M_e = max(R̄_1, ..., R̄_e)
    smoothed: float  # M̄_e


def update_running_maximum(previous: RunningMaximum | None, mean_return: float, rate: float) -> RunningMaximum:
    """Follow the largest mean return with an exponential average, M̄_e.

    M_e = max(M_{e-1}, R̄_e)
    M̄_e = M̄_{e-1} + rate · (M_e - M̄_{e-1}),  M̄_1 = R̄_1

    Choice: the paper says only "smoothed running maximum". Averaging M_e in every episode, and not only in those that
    set a record, brings M̄ up to a lone high return within about 1/rate episodes; otherwise every return above a
    lagging M̄ would share f = 0 for good.

    Args:
        previous: state after the last episode that was not rejected; None before the first.
        mean_return: R̄_e, mean shaped reward per step.
        rate: in (0, 1]; 1 is the plain maximum.

    Returns:
        The new state; `smoothed` never falls and never exceeds `largest`.

    Source: RISK-SAC, Sec. III-E.
    """
    if previous is None:
        return RunningMaximum(mean_return, mean_return)
    largest = max(previous.largest, mean_return)
    return RunningMaximum(largest, min(largest, previous.smoothed + rate * (largest - previous.smoothed)))


@overload
def objective(mean_return: float, running_maximum: float) -> float: ...
@overload
def objective(mean_return: Floats, running_maximum: float) -> Floats: ...
def objective(mean_return: float | Floats, running_maximum: float) -> float | Floats:
    """How far an episode stays below the best returns, f_e; smaller is riskier.

    f_e(ξ) = max(0, M̄_e - R̄_e(ξ)) / (|M̄_e| + ε)                                  (11)

    Args:
        mean_return: R̄_e, one value or an array of any shape.
        running_maximum: M̄_e.

    Returns:
        f_e >= 0, shaped like `mean_return`; NaN where that is NaN.

    Source: RISK-SAC, Sec. III-E, Eq. 11.
    """
    score = np.maximum(0.0, running_maximum - mean_return) / (abs(running_maximum) + EPSILON)
    return score if isinstance(mean_return, np.ndarray) else float(score)
