"""Stable-Baselines3 peers learn from episodes' margins and resume from their state."""

import numpy as np
import pytest

from risk_sac.search.agents.stress import MARGIN_WEIGHT, StressPpo, StressSac

NO_GENES = np.empty(0)
OBSERVATION, ACTIONS = 3, 2


def play(agent, transition, episodes, steps=4, margin=0.3):
    """Plays episodes with the margin at the second step; returns the actions."""
    random, actions = np.random.default_rng(1), []
    for _ in range(episodes):
        agent.begin(NO_GENES)
        for step in range(steps):
            observation = random.standard_normal(OBSERVATION).astype(np.float32)
            actions.append(agent.act(observation))
            told = {"observation": observation, "action": actions[-1], "cost": 0.1}
            agent.observe(transition(next_robustness=margin if step == 1 else 0.8, **told))
    return np.array(actions)


@pytest.mark.parametrize("peer", [StressSac, StressPpo])
def test_the_last_step_of_an_episode_pays_its_margin(peer, transition):
    agent = peer(ACTIONS, seed=0)
    play(agent, transition, 2)
    agent.begin(NO_GENES)
    rewards = agent._buffer.rewards[: agent._buffer.pos, 0]
    np.testing.assert_allclose(rewards, [-0.1, -0.1, -0.1, -0.1 - MARGIN_WEIGHT * 0.3] * 2, rtol=1e-5)
    play(agent, transition, 1, margin=-0.2)
    agent.begin(NO_GENES)
    assert agent._buffer.rewards[11, 0] == pytest.approx(-0.1)  # a failure costs nothing


@pytest.mark.parametrize(("peer", "episodes"), [(StressSac, 26), (StressPpo, 513)])  # past the first update
def test_a_peer_goes_on_as_the_one_that_was_saved(peer, episodes, transition):
    agent, restored = peer(ACTIONS, seed=3), peer(ACTIONS, seed=4)
    before = np.random.get_state()[1].tolist()  # noqa: NPY002
    play(agent, transition, episodes)
    restored.load(agent.state())
    np.testing.assert_array_equal(play(agent, transition, 5), play(restored, transition, 5))
    assert agent._model._n_updates > 0
    assert np.random.get_state()[1].tolist() == before  # noqa: NPY002  # the process's own generator stays
