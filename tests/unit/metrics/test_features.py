import math

import numpy as np

from risk_sac.metrics import outcome_features
from tests.unit.metrics.episodes import contact


def test_outcome_features_are_scaled_and_clipped():
    np.testing.assert_allclose(outcome_features(contact(1.5, 5.0, 0.0, 0.0)), [0.5, 0.25, 0.5, 0.75])
    np.testing.assert_allclose(outcome_features(contact(math.inf, 40.0, -9.0, -math.inf)), [1, 1, 0, 0])
