"""Runs that start from the pretrained policy, and what it sees and does in any scenario."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from risk_sac.config import (
    AgentConfig,
    Budget,
    EgoConfig,
    LearnerConfig,
    Requirement,
    RunMethod,
    RunSpec,
    WarmStartConfig,
)
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.execution.evaluate import run
from risk_sac.failures.bundle import read_bundle, write_bundle
from risk_sac.failures.regress import regress
from risk_sac.failures.studied import Verdict
from risk_sac.failures.study import bundles
from risk_sac.records import DrivenBy, EpisodeRecord, Outcome
from risk_sac.run_folder.results import EPISODES, records_from_lines
from risk_sac.search import searchers
from risk_sac.search.agents.controls import ScriptFollower
from risk_sac.search.loop import execute_run
from risk_sac.search.prior.attacker import Attack, AttackerView
from risk_sac.search.prior.learner import PretrainedLearner
from risk_sac.search.searchers import Searchers
from risk_sac.world.types import Scene, Vector
from tests.builders import episode_record, pretrained_policy
from tests.listener import Listener


def spec(method: RunMethod, episodes: int = 2, family: str = "low", batch: int = 1) -> RunSpec:
    learner = LearnerConfig(agent=AgentConfig(batch_size=8))
    budget = Budget(episodes=episodes, batch=batch)
    return RunSpec(family=family, method=method, seed=5, budget=budget, learner=learner)


@pytest.fixture(autouse=True)
def shipped(monkeypatch: pytest.MonkeyPatch) -> None:
    """A small policy in the place of the shipped one."""
    monkeypatch.setattr(searchers, "shipped_policy", pretrained_policy)


def searchers_of(wanted: RunSpec) -> Searchers:
    problem = Problem.from_spec(wanted)
    return Searchers(wanted, problem, problem.observation_size, problem.action_size)


def played(folder: Path, wanted: RunSpec) -> list[EpisodeRecord]:
    listener = Listener()
    assert execute_run(wanted, folder, listener).finished
    return listener.records


@pytest.mark.parametrize("family", ["low", "dense", "roundabout_entry"])
def test_the_policy_drives_from_the_first_episode_on_and_learns(tmp_path: Path, family: str) -> None:
    records = played(tmp_path, spec("risk-sac-pretrained", 3, family))
    assert [record.driven_by for record in records] == [DrivenBy.POLICY] * 3
    assert records[0].temperature == pytest.approx(0.03, rel=0.1)
    assert len({record.temperature for record in records}) == 3  # each of them has updates


@pytest.mark.parametrize("batch", [1, 2])
def test_an_interrupted_run_goes_on_as_if_it_had_not_been(tmp_path: Path, batch: int) -> None:
    wanted = spec("risk-sac-pretrained", 4, batch=batch)
    whole = played(tmp_path / "whole", wanted)
    halves = Listener(limit=2)
    assert not execute_run(wanted, tmp_path / "parts", halves).finished
    assert played(tmp_path / "parts", wanted) == whole


def test_one_adversary_attacks_and_the_attackers_differ() -> None:
    learner = searchers_of(spec("risk-sac-pretrained")).agent
    assert isinstance(learner, PretrainedLearner)
    seen = np.full(Problem.from_spec(spec("sac")).observation_size, 0.3, np.float32)
    attackers = {explore: set[int]() for explore in (True, False)}
    for explore, found in attackers.items():
        for _ in range(40):
            learner.begin(np.empty(0))
            acts = learner.act(seen, explore).reshape(-1, 2).any(axis=1)
            assert acts.sum() == 1
            found.add(int(acts.argmax()))
    assert len(attackers[False]) == 1  # the one of the greatest value
    assert attackers[False] < attackers[True]


def test_the_diverse_search_shares_its_episodes_between_scripts_and_policy() -> None:
    subject = searchers_of(spec("risk-sac-diverse", family="cyclist_ahead"))
    first = {type(subject.next(learning=True).actor) for _ in range(200)}
    for index in range(WarmStartConfig().failures):
        subject.add(episode_record(index, Outcome.FAILURE))
    later = {type(subject.next(learning=True).actor) for _ in range(1000)}
    assert (first, later) == ({ScriptFollower}, {ScriptFollower, PretrainedLearner})


def test_without_a_prior_the_method_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"risk-sac-pretrained.*choose archive or risk-sac instead$"):
        searchers_of(spec("risk-sac-pretrained").model_copy(update={"prior": "none"}))


TOLERANCE = 0.03  # SUMO's cars on the right slow down a little for those on their left
SCENE = {
    "ego_speed_mps": 12.0,
    "lead_gap_m": 20.0,
    "lead_speed_mps": 11.0,
    "left_offset_m": 4.0,
    "left_speed_mps": 12.0,
    "right_offset_m": -6.0,
    "right_speed_mps": 10.0,
    "follower_gap_m": 25.0,
    "friction": 0.9,
}
MIRRORED = SCENE | {"left_offset_m": -6.0, "left_speed_mps": 10.0, "right_offset_m": 4.0, "right_speed_mps": 12.0}
LEFT, RIGHT = 1, 2


def inputs(env: RiskSacEnv, scene: dict[str, float], attacker: int) -> list[Vector]:
    """What the policy sees while the attacker brakes and drives away from the ego."""
    attack = Attack(AttackerView(env.problem), attacker=attacker)
    observation = env.reset(seed=3, options={"scene": Scene(family="low", values=scene)})[0]
    seen = []
    for _ in range(8):
        seen.append(attack.seen(observation, lambda _: 0.0, explore=False))
        action = attack.acted(np.array([-0.5, 0.3], np.float32))
        action[[2 * LEFT, 2 * RIGHT]] = -0.5  # both brake: before the release their accelerations differ by side
        observation = env.step(action)[0]
    return seen


def test_an_attack_from_the_right_looks_like_its_mirror_image_from_the_left() -> None:
    wanted = RunSpec(family="low", method="sac", seed=3, ego=EgoConfig(driver="idm-aeb"))  # SUMO's driver keeps right
    with closing(RiskSacEnv.of(wanted)) as env:
        left, mirrored, other = (inputs(env, *each) for each in ((SCENE, LEFT), (MIRRORED, RIGHT), (SCENE, RIGHT)))
    for own, image in zip(left, mirrored, strict=True):
        np.testing.assert_allclose(own, image, atol=TOLERANCE)
    assert not np.allclose(left[-1], other[-1], atol=10 * TOLERANCE)  # the scene has two unlike sides


def test_the_policy_of_a_bundle_meets_another_ego(tmp_path: Path) -> None:
    slow = Requirement(name="slow", formula="ego_speed_mps <= 1")  # which the ego violates in each episode
    wanted = spec("risk-sac-pretrained").model_copy(update={"requirements": (slow,)})
    results = run(wanted, tmp_path / "run", lambda episodes, metrics: None)
    episodes = records_from_lines((tmp_path / "run" / EPISODES).read_bytes())
    (bundle,) = bundles(tmp_path / "run", results, episodes[:1])
    write_bundle(tmp_path / "bundle.npz", bundle)
    again = read_bundle(tmp_path / "bundle.npz")
    assert again.policy is not None
    assert again.policy.action_size == 2
    case = regress(again, EgoConfig(reaction_time_s=0.1)).case
    assert case.verdict is Verdict.STILL_FAILING
