"""Outcome features of a failure, and how far apart failures lie in them. Pure."""

from typing import NamedTuple

import numpy as np

from risk_sac.errors import NotFinite
from risk_sac.records import Collision
from risk_sac.types import Floats


class Feature(NamedTuple):
    """One outcome feature and the physical range that is scaled to [0, 1]; values beyond it are clipped."""

    name: str
    low: float
    high: float


# Choice: the paper names the features but no scale. Fixed physical ranges keep OFD comparable between runs.
FEATURES = (
    Feature("early_min_ttc_s", 0.0, 3.0),  # beyond 3 s there is no conflict
    Feature("relative_speed_mps", 0.0, 20.0),  # urban: 72 km/h
    Feature("lateral_offset_m", -3.5, 3.5),  # half a car's length plus half a car's width to either side
    Feature("early_min_robustness", -3.0, 1.0),  # in scales: the monitor clips at -3, and 1 is a clear margin
)


def outcome_features(collision: Collision) -> Floats:
    """The outcome features of one failure, in the order of `FEATURES`, each scaled to [0, 1] and clipped.

    Raises:
        NotFinite: a feature is NaN; infinite ones are clipped.
    """
    values = np.array([getattr(collision, feature.name) for feature in FEATURES], dtype=np.float64)
    if np.isnan(values).any():
        raise NotFinite(f"collision at {collision.time_s:g} s has outcome features {values.tolist()}; wanted no NaN")
    low, high = (np.array([getattr(feature, end) for feature in FEATURES]) for end in ("low", "high"))
    scaled: Floats = ((values - low) / (high - low)).clip(0.0, 1.0)
    return scaled


class Spread:
    """Σ_{i<j} ||x_i - x_j|| over the failures' features; another failure costs as many distances as there are."""

    def __init__(self) -> None:
        self.distance = 0.0
        self._count = 0
        self._features = np.empty((64, len(FEATURES)))  # doubled when full; the first `_count` rows count

    def add(self, features: Floats) -> None:
        """Add one failure: `FEATURES`, scaled."""
        if self._count == len(self._features):
            self._features = np.concatenate((self._features, np.empty_like(self._features)))
        rows = self._features[: self._count]
        self.distance += float(np.sqrt(((rows - features) ** 2).sum(axis=1)).sum())
        self._features[self._count] = features
        self._count += 1
