"""Estimates failure rates from weighted draws, and checks whether they can be trusted.

Source of the interval: the delta method on a ratio of weighted sums, on the logarithm of the rate.
"""

import math
from collections.abc import Mapping

import numpy as np

from risk_sac.metrics import clopper_pearson
from risk_sac.rates.proposal import DECLARED
from risk_sac.records.rates import HourlyRate, RateEstimate
from risk_sac.world.types import Floats

Flags = np.typing.NDArray[np.bool_]
LEAST_EFFECTIVE = 15.0  # failures of equal weight that would tell as much; choice
MOST_OF_ONE = 0.25  # share of the estimate that one draw may have; choice
MOST_DECLARED = 0.5  # share of the estimate that draws of the declared distribution may have; choice
MOST_ERRORS = 4.0  # standard errors by which the mean weight may differ from 1; choice
CONFIDENCE = 0.95
UNSEEN = 1.15  # choice: part of the error comes from regions that no draw reached; repeated experiments cover with it


def estimated(ratios: Floats, trust: Floats, failed: Flags, played: Flags) -> RateEstimate:
    """Estimates the rate of failures among played scenes.

    rate = Σ w f / (n - Σ w u),  w = a p/q,  se² = Σ r² / (n - Σ w u)²,  log rate ± 1.15 t se / rate

    r = w f + rate w u, less its mean. The expected sum of all weights is n, so the sum itself, whose chance deviation
    would add to the error, is not used. t has the effective number of failures, (Σ w f)² / Σ (w f)², less one as its
    degrees of freedom.

    Args:
      ratios: p/q, `n`, density of the declared distribution over that of the draw's own proposal.
      trust: a, `n`, of mean 1; see `Stages.trust`.
      failed: f, `n`.
      played: `n`; of a scene that was not (u), nothing is said.
    """
    weights, failed = ratios * trust, failed & played
    hits, refused, count = weights * failed, weights * ~played, int(failed.sum())
    total = len(weights) - float(refused.sum())
    bound = min(1.0, clopper_pearson(count, len(weights))[1] / DECLARED * len(weights) / max(total, 1e-300))
    if not count or total <= 0.0:
        why = "no draw failed" if not count else "no scene could be played"
        return _unestimated(why, bound, count)
    rate = float(hits.sum()) / total
    parts = hits + rate * refused
    error = math.sqrt(float(((parts - trust * parts.mean()) ** 2).sum())) / total
    effective = float(hits.sum() ** 2 / (hits**2).sum())
    largest = float(hits.max() / hits.sum())
    declared = float((hits * DECLARED * ratios).sum() / hits.sum())
    checks = {"effective_failures": effective, "largest_share": largest, "declared_share": min(declared, 1.0)}
    why = _objection(weights, effective, largest, declared)
    if why:
        return _unestimated(why, bound, count).model_copy(update=checks)
    half = UNSEEN * _student(effective - 1.0) * error / rate
    return RateEstimate(
        failures=count,
        rate=min(rate, 1.0),
        low=min(rate * math.exp(-half), 1.0),
        high=min(rate * math.exp(half), 1.0),
        why="",
        at_most=bound,
        **checks,
    )


def with_exposure(estimates: Mapping[str, RateEstimate], scenes_per_hour: float | None) -> dict[str, RateEstimate]:
    """Adds the rates in an hour that has so many scenes; None adds none."""
    if scenes_per_hour is None:
        return dict(estimates)
    return {name: _hourly(estimate, scenes_per_hour) for name, estimate in estimates.items()}


def _hourly(estimate: RateEstimate, scenes: float) -> RateEstimate:
    if estimate.rate is None or estimate.low is None or estimate.high is None:
        return estimate
    hourly = HourlyRate(rate=estimate.rate * scenes, low=estimate.low * scenes, high=estimate.high * scenes)
    return estimate.model_copy(update={"per_hour": hourly})


def _objection(weights: Floats, effective: float, largest: float, declared: float) -> str:
    """Why an estimate is not to be trusted; empty if it is."""
    error = float(weights.std()) / math.sqrt(len(weights))
    if abs(float(weights.mean()) - 1.0) > MOST_ERRORS * error + 1e-9:
        return f"the mean weight is {weights.mean():.2f}, not 1"
    if effective < LEAST_EFFECTIVE:
        return f"the failures tell as much as {effective:.1f} of equal weight; {LEAST_EFFECTIVE:g} are needed"
    if largest > MOST_OF_ONE:
        return f"one draw has {largest:.0%} of the estimate; {MOST_OF_ONE:.0%} are allowed"
    if declared > MOST_DECLARED:
        return f"draws of the declared distribution have {declared:.0%} of the estimate, so failures may lie elsewhere"
    return ""


def _unestimated(why: str, bound: float, count: int) -> RateEstimate:
    return RateEstimate(
        failures=count,
        rate=None,
        low=None,
        high=None,
        why=why,
        at_most=bound,
        effective_failures=0.0,
        largest_share=0.0,
        declared_share=0.0,
    )


def _student(freedom: float) -> float:
    """Two-sided 95 % quantile of Student's t distribution."""
    from scipy.special import stdtrit  # here, because few ask for it, and every process of a server loads this

    return float(stdtrit(max(freedom, 1.0), 1.0 - (1.0 - CONFIDENCE) / 2.0))
