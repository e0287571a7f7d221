from dataclasses import replace

import numpy as np
import pytest

from risk_sac.search.agents.snapshot import SnapshotActor, explored
from tests.unit.search.agents.test_learner import CONFIG, LEARNING, learner, live

OBSERVATION = np.array([0.3, -1.0, 0.5], np.float32)
DRAWS = 4000


@pytest.mark.parametrize("method", LEARNING)
def test_a_snapshot_explores_as_the_learner_does(method, random_transition):
    """Mean and spread of actions agree; the noise has another generator."""
    subject = learner(method)
    live(subject, 60, random_transition, np.random.default_rng(0))
    actor = SnapshotActor(subject.snapshot(), seed=1)
    theirs, ours = (np.array([one.act(OBSERVATION) for _ in range(DRAWS)]) for one in (subject, actor))
    assert ours.dtype == np.float32
    deviation = theirs.std(axis=0)
    assert (deviation > 0.01).all()
    np.testing.assert_allclose(ours.mean(axis=0), theirs.mean(axis=0), atol=6 * deviation.max() / np.sqrt(DRAWS))
    np.testing.assert_allclose(ours.std(axis=0), deviation, rtol=0.1)
    frozen = [one.act(OBSERVATION, explore=False) for one in (actor, subject)]
    np.testing.assert_allclose(*frozen, atol=1e-6)


@pytest.mark.parametrize("method", LEARNING)
def test_what_was_played_elsewhere_is_learnt_as_if_it_had_been_played_here(method, random_transition):
    here, elsewhere = learner(method), learner(method)
    stream = np.random.default_rng(0)
    for number, own in enumerate((True, False, True, True)):  # the first episode ends within the warm-up
        steps = [random_transition(stream) for _ in range(17)]
        here.begin(np.empty(0))
        for step in steps:
            here.observe(step, own=own)
            if own:
                here.update()
        elsewhere.learn(steps, elsewhere.snapshot(), seed=number, own=own)
        assert elsewhere.dual_variable == here.dual_variable
        assert elsewhere.temperature == here.temperature
    one, two = (subject.snapshot() for subject in (here, elsewhere))
    assert one.random_steps == two.random_steps == 0
    for left, right in zip(one.policy.layers, two.policy.layers, strict=True):
        np.testing.assert_array_equal(left, right)


def test_a_snapshot_stays_as_it_was_taken(random_transition):
    subject = learner()
    before = subject.snapshot()
    kept = [layer.copy() for layer in before.policy.layers]
    assert subject.snapshot() is before
    steps = [random_transition(np.random.default_rng(i)) for i in range(60)]
    subject.learn(steps, before, seed=0, own=True)
    after = subject.snapshot()
    assert any((one != two).any() for one, two in zip(before.policy.layers, after.policy.layers, strict=True))
    assert all((one == two).all() for one, two in zip(before.policy.layers, kept, strict=True))
    back = after.at(before.state())
    assert back.dual_variable == before.dual_variable
    assert SnapshotActor(back, 3).act(OBSERVATION).tolist() == SnapshotActor(before, 3).act(OBSERVATION).tolist()


def test_an_action_is_held_and_the_first_steps_are_random(random_transition):
    agent = CONFIG.agent.model_copy(update={"decision_steps": 3})
    actor = SnapshotActor(learner(config=CONFIG.model_copy(update={"agent": agent})).snapshot(), seed=0)
    actions = []
    for _ in range(30):
        actions.append(tuple(actor.act(OBSERVATION)))
        actor.observe(random_transition(np.random.default_rng(0)))
    assert [len(set(actions[i : i + 3])) for i in range(0, 30, 3)] == [1] * 10
    assert len(set(actions)) == 10
    expected = np.random.default_rng(0)
    expected.integers(1)
    first = [expected.uniform(-1, 1, 2).astype(np.float32).tolist() for _ in range(7)]  # warm-up of 20 steps
    assert [list(action) for action in actions[:21:3]] == first


def test_costs_of_random_actions_are_not_priced_whatever_was_told_meanwhile(random_transition):
    """Both episodes of a round begin with the warm-up's random actions."""
    subject = learner()
    costly = [replace(random_transition(np.random.default_rng(i)), cost=1.0) for i in range(20)]
    snapshot = subject.snapshot()
    for seed in (0, 1):
        subject.learn(costly, snapshot, seed, own=True)
    assert subject.dual_variable == 0.0
    subject.learn(costly, subject.snapshot(), 2, own=True)
    assert subject.dual_variable > 0.0


@pytest.mark.parametrize(
    ("exploration", "outputs", "mean", "deviation"),
    [
        (0.0, [0.5], np.tanh(0.5), 0.0),
        (0.1, [0.0], 0.0, 0.1),
        ("clipped", [0.0, -3.0], 0.0, np.exp(-3.0)),
        ("clipped", [0.7, -90.0], np.tanh(0.7), 0.0),
        ("squashed", [0.0, -1.0], 0.0, np.exp(3.5 * np.tanh(-1.0) - 1.5)),
    ],
)
def test_noise_has_the_deviation_that_the_outputs_say(exploration, outputs, mean, deviation):
    random = np.random.default_rng(0)
    drawn = np.array([explored(np.array(outputs, np.float32), exploration, random)[0] for _ in range(DRAWS)])
    assert drawn.mean() == pytest.approx(mean, abs=0.005)
    assert drawn.std() == pytest.approx(deviation, rel=0.05, abs=1e-6)
