import io
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from risk_sac.config import METHODS, AgentConfig, LagrangianConfig, LearnerConfig, MethodName, ReplayConfig
from risk_sac.errors import NotFinite
from risk_sac.search.agents.learner import Learner
from risk_sac.search.agents.transition import Transition

Make = Callable[..., Transition]
CONFIG = LearnerConfig(
    agent=AgentConfig(
        hidden_sizes=(8,), batch_size=16, discount=0.98, warmup_steps=20, decision_steps=1, updates_per_step=0.25
    ),
    replay=ReplayConfig(capacity=1000),
    lagrangian=LagrangianConfig(learning_rate=0.01, cost_limit=0.1),
)
LEARNING = tuple(name for name, method in METHODS.items() if method.learns)


def learner(method: MethodName = "risk-sac", config: LearnerConfig = CONFIG, seed: int = 0) -> Learner:
    return Learner(3, 2, METHODS[method], config, seed)


def live(subject: Learner, steps: int, make: Make, stream: np.random.Generator) -> list[list[float]]:
    """Runs the learner on random experience and returns all that it decided."""
    trace = []
    for _ in range(steps):
        drawn = make(stream)
        trace.append(subject.act(drawn.observation).tolist())
        subject.observe(drawn)
        result = subject.update()
        trace.append([subject.dual_variable, subject.temperature, result.critic_loss if result else -1.0])
    return trace


@pytest.mark.parametrize("method", LEARNING)
def test_resumed_learner_equals_one_never_interrupted_bit_for_bit(method, random_transition):
    original, resumed = learner(method), learner(method, seed=5)
    live(original, 60, random_transition, np.random.default_rng(0))
    file = io.BytesIO()
    torch.save(original.state(), file)
    file.seek(0)
    resumed.load(torch.load(file, weights_only=True))
    traces = [live(each, 60, random_transition, np.random.default_rng(1)) for each in (original, resumed)]
    assert traces[0] == traces[1]


@pytest.mark.parametrize("method", LEARNING)
def test_a_frozen_policy_acts_as_the_learner_does_without_exploring(method, random_transition):
    subject = learner(method)
    live(subject, 40, random_transition, np.random.default_rng(0))
    frozen = subject.frozen()
    observations = np.random.default_rng(1).standard_normal((20, 3)).astype(np.float32)
    before = [subject.act(each, explore=False) for each in observations]
    live(subject, 20, random_transition, np.random.default_rng(2))
    np.testing.assert_allclose([frozen(each) for each in observations], before, atol=1e-6)
    frozen.check(3)
    with pytest.raises(ValueError, match="wanted from 4 to 2"):
        frozen.check(4)
    first, *others = (np.full_like(layer, 3e38) for layer in frozen.layers)
    others[1][::2] *= -1.0
    wild = replace(frozen, layers=(first, *others))
    wild.check(3)
    with pytest.raises(NotFinite):
        wild(np.array([1.0, -1.0, 1.0], np.float32))


def test_warm_up_acts_at_random_and_learns_nothing(random_transition):
    subject = learner()
    stream = np.random.default_rng(0)
    before = subject.act(np.ones(3, np.float32), explore=False)
    for _ in range(CONFIG.agent.warmup_steps - 1):
        assert (np.abs(subject.act(np.ones(3, np.float32))) <= 1.0).all()
        subject.observe(random_transition(stream))
        assert subject.update() is None
    assert np.array_equal(subject.act(np.ones(3, np.float32), explore=False), before)
    subject.observe(random_transition(stream))
    assert subject.update() is not None
    assert not np.array_equal(subject.act(np.ones(3, np.float32), explore=False), before)


def steps_of_updates(pace: float, warmup_steps: int, steps: int, make: Make) -> list[int]:
    """In which step each update came."""
    agent = CONFIG.agent.model_copy(update={"warmup_steps": warmup_steps, "updates_per_step": pace})
    subject, updates = learner(config=CONFIG.model_copy(update={"agent": agent})), []
    subject._update_once = lambda: updates.append(subject._steps)
    stream = np.random.default_rng(0)
    for _ in range(steps):
        subject.observe(make(stream))
        subject.update()
    return updates


@pytest.mark.parametrize(("pace", "expected"), [(0.25, 10), (0.3, 12), (1, 40), (3, 120), (0, 0)])
def test_updates_keep_the_pace_that_is_asked_for(pace, expected, random_transition):
    updates = steps_of_updates(pace, 1, 40, random_transition)
    assert len(updates) == expected
    for step in range(1, 41):  # spread evenly: never more than one ahead or behind
        assert abs(sum(at <= step for at in updates) - pace * step) < 1


def test_updates_keep_pace_with_own_steps_and_with_those_that_came_before_them(random_transition):
    subject, updates = learner(), []
    subject._update_once = lambda: updates.append(1)
    stream = np.random.default_rng(0)
    for own, steps, expected in ((False, 40, 0), (True, 40, 20), (False, 400, 20), (True, 40, 30)):
        for _ in range(steps):
            subject.observe(random_transition(stream), own=own)
            if own:
                subject.update()
        assert len(updates) == expected


def test_the_policy_decides_every_few_steps_and_its_memory_holds_decisions(random_transition):
    agent = CONFIG.agent.model_copy(update={"decision_steps": 4})
    subject = learner(config=CONFIG.model_copy(update={"agent": agent}))
    stream = np.random.default_rng(0)
    for _ in range(2):  # episodes, of which the second begins with a decision of its own
        subject.begin(np.empty(0))
        actions = []
        for _ in range(10):
            actions.append(subject.act(np.ones(3, np.float32)).tolist())
            subject.observe(random_transition(stream))
        assert [actions.index(each) for each in actions] == [0] * 4 + [4] * 4 + [8] * 2
    assert len(subject._replay) == 2 * 2
    assert subject._config.agent.discount == pytest.approx(0.98**4)


def test_a_batch_is_learnt_from_with_the_dual_variable_of_the_moment(transition, monkeypatch):
    subject, rewards = learner("sac-lag"), []
    update = subject._agent.update

    def watched(batch, reward):
        rewards.append((reward - batch.risk_reward).tolist())
        return update(batch, reward)

    monkeypatch.setattr(subject._agent, "update", watched)
    for _ in range(CONFIG.agent.warmup_steps):
        subject.observe(transition(cost=0.3))  # when λ was 0
    subject.dual_variable = 2.0
    subject.update()
    assert rewards == [pytest.approx([-2.0 * 0.3] * CONFIG.agent.batch_size)]
