import numpy as np
import pytest

from risk_sac.failures.minimise import changed

ACTIONS = np.zeros((60, 4), np.float32)
ACTIONS[10:40, 2] = np.where(np.arange(30) % 4 < 2, 1.0, -1.0)


@pytest.mark.parametrize("seed", range(30))
def test_a_change_is_of_one_column_that_acts(seed: int):
    made = changed(ACTIONS, np.random.default_rng(seed))
    assert made.shape == ACTIONS.shape
    assert made.dtype == ACTIONS.dtype
    assert np.abs(made).max() <= 1.0
    np.testing.assert_array_equal(np.delete(made, 2, axis=1), np.delete(ACTIONS, 2, axis=1))


def test_changes_make_a_motion_smoother_weaker_and_absent():
    made = [changed(ACTIONS, np.random.default_rng(seed))[:, 2] for seed in range(200)]
    rough = [np.abs(np.diff(column)).sum() for column in made]
    assert min(rough) < np.abs(np.diff(ACTIONS[:, 2])).sum() / 2
    assert min(np.abs(column).sum() for column in made) < np.abs(ACTIONS).sum() / 3


def test_what_does_nothing_stays():
    np.testing.assert_array_equal(changed(ACTIONS[:5], np.random.default_rng(0)), ACTIONS[:5])
