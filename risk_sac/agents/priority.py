"""Risk-guided priorities and the weights that correct for them.

Source: RISK-SAC, Sec. III-D, Eq. 9-10; Schaul et al., "Prioritized experience replay", 2016.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from risk_sac.config.learner import ReplayConfig
from risk_sac.jit import compiled
from risk_sac.types import Floats

# No term counts for more than ten average ones, so that one outlier cannot fill the batch.
TERM_CAP = 10.0


@dataclass(frozen=True, slots=True)
class TermScales:
    """Affine map of each term of (9) to a common scale.

    Choice: a term x becomes (x - min x) / (mean x - min x), clipped to [0, 10]. It is then never negative
    and 1 on average, so w1 : w2 : w3 are the shares of all sampling that the three terms decide. A term
    that is the same for all transitions tells them apart in nothing and becomes 0.
    """

    lowest: Floats  # 3
    inverse_spread: Floats  # 3; 0 for a constant term

    @classmethod
    def of(cls, terms: Floats) -> Self:
        """Scales of the stored terms, `3 x n` with n at least 1."""
        lowest = terms.min(axis=1)
        spread = terms.mean(axis=1) - lowest
        # Rounding in the mean of equal numbers is no spread.
        real = spread > 1e-9 * np.maximum(1.0, np.abs(lowest))
        return cls(lowest, np.divide(1.0, spread, out=np.zeros_like(spread), where=real))


def priority(terms: Floats, scales: TermScales, config: ReplayConfig) -> Floats:
    """Priorities of transitions.

    p_i = max(ε, w1 |δ_i| + w2 R̂_i + w3 (-ρ_i)), each term on its common scale             (9)

    Deviation: the paper adds raw terms, which differ in scale and can be negative, and has no floor ε.

    Args:
      terms: `3 x n`: |δ|, R̂ and -ρ(Φ, s), as measured.
      scales: their common scale.
      config: w1, w2, w3 and ε.

    Returns:
      `n`, at least ε > 0.
    """
    weights = config.td_weight, config.return_weight, config.robustness_weight
    return _priorities(terms, scales.lowest, scales.inverse_spread, weights, config.priority_floor)


@compiled
def _priorities(
    terms: Floats, lowest: Floats, inverse_spread: Floats, weights: tuple[float, float, float], floor: float
) -> Floats:
    # A loop: of a batch, numpy's dozen calls cost more than what they do.
    priorities = np.empty(terms.shape[1])
    for i in range(len(priorities)):
        weighted = 0.0
        for term in range(len(weights)):
            scaled = (terms[term, i] - lowest[term]) * inverse_spread[term]
            weighted += weights[term] * min(max(scaled, 0.0), TERM_CAP)
        priorities[i] = max(weighted, floor)
    return priorities


def importance_weights(probabilities: Floats, size: int, correction: float) -> Floats:
    """Importance weights of sampled transitions.

    w_i = (1 / (N P(i)))^η / max_j w_j                                                (10)

    Deviation: divided by the largest weight of the batch, so that weights only ever shorten a step.

    Args:
      probabilities: P(i) > 0 of the sampled transitions, `n`.
      size: N, transitions stored.
      correction: η in [0, 1].

    Returns:
      `n`, in (0, 1].
    """
    weights = (size * probabilities) ** -correction
    return np.asarray(weights / weights.max(), np.float64)
