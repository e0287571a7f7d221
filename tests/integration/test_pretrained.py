"""Runs that start from a pretrained policy."""

from pathlib import Path

import numpy as np
import pytest

from risk_sac.config import AgentConfig, Budget, LearnerConfig, RunMethod, RunSpec
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.records import DrivenBy, EpisodeRecord
from risk_sac.search import searchers
from risk_sac.search.agents.controls import ScriptFollower
from risk_sac.search.loop import execute_run
from risk_sac.search.prior.learner import PretrainedLearner
from risk_sac.search.prior.mirror import Mirror
from risk_sac.search.prior.policy import PolicyLayout
from risk_sac.search.searchers import Searchers
from tests.builders import pretrained_policy
from tests.listener import Listener


def spec(method: RunMethod, episodes: int = 2) -> RunSpec:
    learner = LearnerConfig(agent=AgentConfig(batch_size=8))
    return RunSpec(family="low", method=method, seed=5, budget=Budget(episodes=episodes), learner=learner)


@pytest.fixture
def layout() -> PolicyLayout:
    return PolicyLayout.of(Problem.from_spec(spec("risk-sac-pretrained")))


@pytest.fixture(autouse=True)
def shipped(monkeypatch: pytest.MonkeyPatch, layout: PolicyLayout) -> None:
    """A small policy in the place of the shipped one."""
    monkeypatch.setattr(searchers, "pretrained_for", lambda family: pretrained_policy(layout))


def searchers_of(wanted: RunSpec) -> Searchers:
    problem = Problem.from_spec(wanted)
    return Searchers(wanted, problem, problem.observation_size, problem.action_size)


def played(folder: Path, wanted: RunSpec) -> list[EpisodeRecord]:
    listener = Listener()
    assert execute_run(wanted, folder, listener).finished
    return listener.records


def test_the_policy_drives_from_the_first_episode_on_and_learns(tmp_path: Path) -> None:
    records = played(tmp_path, spec("risk-sac-pretrained", 3))
    assert [record.driven_by for record in records] == [DrivenBy.POLICY] * 3
    assert records[0].temperature == pytest.approx(0.03, rel=0.1)
    assert len({record.temperature for record in records}) == 3  # each of them has updates


def test_an_interrupted_run_goes_on_as_if_it_had_not_been(tmp_path: Path) -> None:
    whole = played(tmp_path / "whole", spec("risk-sac-pretrained", 4))
    halves = Listener(limit=2)
    wanted = spec("risk-sac-pretrained", 4)
    assert not execute_run(wanted, tmp_path / "parts", halves).finished
    assert played(tmp_path / "parts", wanted) == whole


def test_every_other_episode_is_seen_in_the_mirror(layout: PolicyLayout) -> None:
    learner = searchers_of(spec("risk-sac-pretrained")).agent
    assert isinstance(learner, PretrainedLearner)
    seen = np.full(layout.observation_size, 0.3, np.float32)
    frozen, mirror = learner.frozen(), Mirror.of(layout)
    assert mirror is not None
    evaluated = (frozen(seen), mirror.action(frozen(mirror.observation(seen))))
    drawn = set[bool]()
    for _ in range(40):
        learner.begin(np.empty(0))
        drawn.add(learner._reflected)
        np.testing.assert_allclose(learner.act(seen, explore=False), evaluated[learner._reflected], atol=1e-6)
    assert drawn == {False, True}


def test_the_diverse_search_shares_its_episodes_between_scripts_and_policy() -> None:
    subject = searchers_of(spec("risk-sac-diverse"))
    drivers = {type(subject.next(learning=True).actor) for _ in range(200)}
    assert drivers == {ScriptFollower, PretrainedLearner}


def test_without_a_pretrained_policy_the_method_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"risk-sac-pretrained at dense.*choose risk-sac there$"):
        searchers_of(spec("risk-sac-pretrained").model_copy(update={"family": "dense"}))
