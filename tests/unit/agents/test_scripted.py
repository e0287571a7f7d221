import numpy as np

from risk_sac.agents.scripted import ScriptedAgent
from risk_sac.observation_layout import PER_ADVERSARY, X_M, Y_M


def seen(x_m: float, y_m: float, cos: float) -> list[float]:
    return [x_m / X_M, y_m / Y_M, 0.0, 0.0, cos, *[0.0] * (PER_ADVERSARY - 5)]


def test_those_ahead_cut_in_and_brake_and_all_others_keep_on() -> None:
    ahead_left, beside, oncoming, crossing = seen(12, 3.5, 1), seen(2, -3.5, 1), seen(40, 3.5, -1), seen(20, 5, 0)
    observation = np.array([*ahead_left, *beside, *oncoming, *crossing, 0.5, 0.5], np.float32)
    action = ScriptedAgent(8, seed=0).act(observation)
    assert action.tolist() == [-0.5, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]


def test_the_cut_in_ends_in_the_middle_of_the_ego_s_path() -> None:
    action = ScriptedAgent(2, seed=0).act(np.array(seen(12, 0.25, 1), np.float32))
    assert action.tolist() == [-0.5, -0.25]
