import numpy as np
import pytest

from risk_sac.failures.recording import actions_of, trajectory_digest


def series() -> dict[str, np.ndarray]:
    return {
        "time_s": np.arange(4.0),
        "released_s": np.array(1.0),
        "ids": np.array(["ego", "a"]),
        "x_m": np.ones((4, 2)),
    }


def test_the_digest_is_of_the_arrays_and_of_nothing_else() -> None:
    backwards = dict(reversed(series().items()))
    backwards["x_m"] = np.asfortranarray(backwards["x_m"])
    assert trajectory_digest(backwards) == trajectory_digest(series())


@pytest.mark.parametrize(
    "change",
    [
        {"x_m": np.nextafter(np.ones((4, 2)), 2)},
        {"x_m": np.ones((2, 4))},
        {"x_m": np.ones((4, 2), np.float32)},
        {"y_m": np.ones((4, 2))},
        {"ids": np.array(["ego", "b"])},
    ],
    ids=["a bit", "shape", "type", "one more", "a name"],
)
def test_the_digest_changes_with_every_bit(change: dict[str, np.ndarray]) -> None:
    assert trajectory_digest(series() | change) != trajectory_digest(series())


def test_the_actions_are_those_after_the_release() -> None:
    actions = np.array([[np.nan], [np.nan], [0.2], [0.3]], np.float32)
    np.testing.assert_array_equal(actions_of(series() | {"actions": actions}), actions[2:])
