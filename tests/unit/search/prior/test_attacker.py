"""What the policy of one adversary sees and does."""

from dataclasses import replace

import numpy as np
import pytest

from risk_sac.config import LearnerConfig, RunSpec, method_of
from risk_sac.env.observation_layout import PER_ADVERSARY
from risk_sac.env.problem import Problem
from risk_sac.scenario.reading import shipped_names
from risk_sac.search.agents.snapshot import SnapshotActor
from risk_sac.search.agents.transition import Transition
from risk_sac.search.frozen_policy import FrozenPolicy, network
from risk_sac.search.prior.attacker import INPUT_SIZE, Attack, AttackerView, going_on
from risk_sac.search.prior.learner import PretrainedLearner
from risk_sac.world.types import Vector
from tests.builders import pretrained_policy


def problem(family: str = "dense") -> Problem:
    return Problem.from_spec(RunSpec(family=family, method="risk-sac-pretrained", seed=0))


def observed(at: Problem, seed: int = 4) -> Vector:
    return np.random.default_rng(seed).random(at.observation_size).astype(np.float32)


def decision(at: Problem, action: Vector) -> Transition:
    return Transition(
        observation=observed(at),
        action=action,
        risk_reward=0.0,
        cost=0.0,
        robustness=0.0,
        next_robustness=0.0,
        next_observation=observed(at, 5),
        terminated=False,
        accumulated_reward=0.0,
    )


def test_the_input_has_one_size_in_every_scenario():
    for family in shipped_names():
        at = problem(family)
        for attacker in range(len(at.family.adversaries)):
            seen = AttackerView(at).seen(observed(at), attacker, mirrored=False)
            assert seen.shape == (INPUT_SIZE,)
            assert np.isfinite(seen).all()


def test_the_order_of_the_others_makes_no_difference():
    at = problem()
    vehicles = len(at.family.vehicles)
    turned = replace(at, family=replace(at.family, vehicles=at.family.vehicles[::-1]))
    seen = observed(at)
    rows = seen[: PER_ADVERSARY * vehicles].reshape(vehicles, -1)
    other = np.concatenate([rows[::-1].ravel(), seen[rows.size :]])
    for attacker in range(vehicles):
        own = AttackerView(at).seen(seen, attacker, mirrored=False)
        np.testing.assert_allclose(own, AttackerView(turned).seen(other, vehicles - 1 - attacker, False), atol=1e-5)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_steering_changes_its_sign_for_an_attacker_on_the_right(side):
    at = problem()
    seen = observed(at)
    seen[PER_ADVERSARY + 1] = side * 0.4
    attack = Attack(AttackerView(at), attacker=1)
    attack.seen(seen, lambda _: 0.0, explore=False)
    acted = attack.acted(np.array([0.5, 0.2], np.float32)).reshape(-1, 2)
    np.testing.assert_allclose(acted[1], [0.5, side * 0.2])
    assert not np.delete(acted, 1, 0).any()


def test_an_adversary_that_left_the_net_is_not_chosen():
    at = problem()
    seen = observed(at)
    seen[: PER_ADVERSARY * 3] = 0.0
    attack = Attack(AttackerView(at))
    attack.seen(seen, lambda _: 0.0, explore=False)
    assert attack.attacker == 3


def test_of_a_script_the_adversary_that_acts_is_the_attacker():
    at = problem()
    attack = Attack(AttackerView(at))
    assert attack.transition(decision(at, np.zeros(8, np.float32))) is None
    action = np.zeros(8, np.float32)
    action[2:6] = 0.1, 0.1, 0.6, -0.3
    seen = attack.transition(decision(at, action))
    assert seen is not None
    assert attack.attacker == 2
    np.testing.assert_allclose(seen.action, [0.6, -0.3])
    np.testing.assert_array_equal(seen.observation, AttackerView(at).seen(observed(at), 2, mirrored=False))


def test_a_snapshot_drives_and_is_learnt_from_as_the_learner_itself():
    at = problem()
    learner = PretrainedLearner(pretrained_policy(), at, method_of("risk-sac-pretrained"), LearnerConfig(), 5)
    snapshot = learner.snapshot()
    again = snapshot.at(snapshot.state())
    for seed in range(6):
        seen, view = observed(at, seed), AttackerView(at)
        learner.begin(np.empty(0))
        frozen = learner.act(seen, explore=False)
        assert frozen.any()
        drawn = SnapshotActor(again, seed, view.begin).act(seen, explore=False)
        np.testing.assert_allclose(drawn, frozen, atol=1e-6)
    actor = SnapshotActor(snapshot, 3, AttackerView(at).begin)
    steps = [replace(decision(at, actor.act(observed(at))), observation=observed(at)) for _ in range(40)]
    learner.learn(steps, snapshot, 3, own=True)
    assert learner.state()["updates"] == 5  # of 40 steps, 0.14 each


def test_a_frozen_policy_goes_on_with_the_attacker_of_the_recorded_actions():
    at, policy = problem(), network(pretrained_policy().policy)
    actions = np.zeros((5, 8))
    actions[2, 6:] = 0.1
    drive = going_on(FrozenPolicy(tuple(policy), 2, normalised=True), at, actions)
    assert drive(observed(at)).reshape(-1, 2).any(axis=1).tolist() == [False, False, False, True]
