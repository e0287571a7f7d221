import numpy as np

from risk_sac.agents.controls import RandomAgent, ScriptedAgent
from risk_sac.observation_layout import PER_ADVERSARY, X_M, Y_M

NOTHING = np.zeros(1, dtype=np.float32)
ADVERSARIES = 3


def played(agent: RandomAgent, steps: int) -> np.ndarray:
    """`steps x adversaries x 2`."""
    return np.array([agent.act(NOTHING) for _ in range(steps)]).reshape(steps, ADVERSARIES, 2)


def test_actions_are_uniform_and_in_the_space() -> None:
    actions = played(RandomAgent(2 * ADVERSARIES, seed=0), 20_000)
    assert actions.dtype == np.float32
    assert np.abs(actions).max() <= 1.0
    shares, _ = np.histogram(actions, bins=4, range=(-1, 1))
    np.testing.assert_allclose(shares / actions.size, 0.25, atol=0.02)


def test_each_adversarys_action_is_held_for_a_second_on_average_and_changes_as_a_whole() -> None:
    actions = played(RandomAgent(2 * ADVERSARIES, seed=1), 20_000)
    changed = np.diff(actions, axis=0) != 0.0
    assert np.array_equal(changed[..., 0], changed[..., 1])
    np.testing.assert_allclose(changed[..., 0].mean(axis=0), 0.1, atol=0.01)
    both = (changed[:, 0, 0] & changed[:, 1, 0]).mean()  # each by itself: 0.1 · 0.1
    np.testing.assert_allclose(both, 0.01, atol=0.004)


def test_a_restored_agent_goes_on_as_the_one_that_was_saved() -> None:
    agent = RandomAgent(2 * ADVERSARIES, seed=3)
    played(agent, 7)
    state = agent.state()
    expected = played(agent, 100)
    restored = RandomAgent(2 * ADVERSARIES, seed=4)
    restored.load(state)
    assert np.array_equal(played(restored, 100), expected)


def seen(x_m: float, y_m: float, cos: float) -> list[float]:
    return [x_m / X_M, y_m / Y_M, 0.0, 0.0, cos, *[0.0] * (PER_ADVERSARY - 5)]


def test_those_ahead_cut_in_and_brake_and_all_others_keep_on() -> None:
    ahead_left, beside, oncoming, crossing = seen(12, 3.5, 1), seen(2, -3.5, 1), seen(40, 3.5, -1), seen(20, 5, 0)
    observation = np.array([*ahead_left, *beside, *oncoming, *crossing, 0.5, 0.5], np.float32)
    action = ScriptedAgent(8, seed=0).act(observation)
    assert action.tolist() == [-0.5, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    in_the_path = ScriptedAgent(2, seed=0).act(np.array(seen(12, 0.25, 1), np.float32))
    assert in_the_path.tolist() == [-0.5, -0.25]
