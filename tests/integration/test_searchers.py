"""Turns between a method's own searcher and its guide; search ends."""

import subprocess
import sys
from pathlib import Path

import pytest

from risk_sac.config import AgentConfig, Budget, FamilyName, LearnerConfig, RunMethod, RunSpec, WarmStartConfig
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.records import DrivenBy, EpisodeRecord, Grade, Outcome
from risk_sac.search.agents.controls import ScriptFollower
from risk_sac.search.agents.learner import Learner
from risk_sac.search.encounter import Encounter
from risk_sac.search.loop import execute_run
from risk_sac.search.prior.learner import PretrainedLearner
from risk_sac.search.scene_optimizer import ArchiveOptimizer
from risk_sac.search.searchers import GUIDE, OWN, Searchers, Turns
from tests.builders import collision, episode_record, judgement
from tests.listener import Listener

WARM = 3


def spec(
    method: RunMethod, budget: Budget, warm_start: WarmStartConfig | None = None, family: FamilyName = "low"
) -> RunSpec:
    agent = AgentConfig(hidden_sizes=(8,), batch_size=8, warmup_steps=50)
    learner = LearnerConfig(agent=agent, warm_start=warm_start or WarmStartConfig(episodes=WARM))
    return RunSpec(family=family, method=method, seed=5, budget=budget, learner=learner)


def played(folder: Path, wanted: RunSpec) -> list[EpisodeRecord]:
    listener = Listener()
    assert execute_run(wanted, folder, listener).finished
    return listener.records


@pytest.mark.parametrize("method", ["risk-sac", "ddpg"])
def test_a_learner_is_warmed_by_what_an_archive_search_would_have_tried(tmp_path: Path, method: RunMethod) -> None:
    bred = played(tmp_path / "bred", spec("archive", Budget(episodes=WARM + 1)))
    warmed = played(tmp_path / "warmed", spec(method, Budget(episodes=WARM + 1)))
    same = [
        (one.scene, one.steps, one.outcome) == (two.scene, two.steps, two.outcome)
        for one, two in zip(bred, warmed, strict=True)
    ]
    assert same == [True] * WARM + [False]
    assert [record.driven_by for record in warmed] == [*[DrivenBy.RANDOM] * WARM, DrivenBy.POLICY]
    assert {record.temperature for record in warmed[:WARM]} == {warmed[0].temperature}  # nothing is learned meanwhile


def searchers(method: RunMethod, warm_start: WarmStartConfig, family: FamilyName = "low") -> Searchers:
    wanted = spec(method, Budget(episodes=100), warm_start, family)
    return Searchers(wanted, Problem.from_spec(wanted), observation_size=20, action_size=4)


def makers(subject: Searchers, outcomes: list[Outcome]) -> list[type]:
    """The searcher of each episode, the next one included."""
    found = []
    for index, outcome in enumerate(outcomes):
        found.append(type(subject.next(learning=True).actor))
        subject.add(episode_record(index, outcome))
    return [*found, type(subject.next(learning=True).actor)]


def test_a_guide_has_done_its_part_after_so_many_episodes_or_failures() -> None:
    few = WarmStartConfig(episodes=3, failures=2)
    quiet, eventful = [Outcome.SAFE] * 3, [Outcome.FAILURE, Outcome.FAILURE]
    assert makers(searchers("risk-sac", few), quiet) == [ScriptFollower] * 3 + [Learner]
    assert makers(searchers("risk-sac", few), eventful) == [ScriptFollower] * 2 + [Learner]
    assert makers(searchers("risk-sac", WarmStartConfig(episodes=0)), []) == [Learner]
    assert makers(searchers("archive", few), quiet) == [ScriptFollower] * 4


def test_a_guide_that_goes_on_anyway_has_time_until_it_has_found_enough() -> None:
    few = WarmStartConfig(episodes=3, failures=2)
    assert makers(searchers("risk-sac-diverse", few, "dense"), [Outcome.SAFE] * 20) == [ScriptFollower] * 21
    taken = makers(searchers("risk-sac-diverse", few, "dense"), [Outcome.FAILURE] * 2 + [Outcome.SAFE] * 60)
    assert taken[:2] == [ScriptFollower] * 2
    assert set(taken[2:]) == {ScriptFollower, PretrainedLearner}


def test_a_guide_has_done_its_part_once_its_last_episode_is_out() -> None:
    subject = searchers("risk-sac", WarmStartConfig(episodes=3, failures=2))
    assert [type(subject.next(learning=True, out=out).actor) for out in (2, 3)] == [ScriptFollower, Learner]


def test_an_episode_of_the_guide_says_nothing_about_the_arm_of_the_policys_scenes() -> None:
    subject = searchers("risk-sac", WarmStartConfig())
    subject.recall(guided=False, origin={"arm": 1})
    assert subject.origin == {"arm": 1}
    subject.recall(guided=True, origin={"parent": None})
    assert subject.guided
    subject.recall(guided=False)
    assert subject.origin == {"arm": None}


def shares(*findings: tuple[int, str, Grade]) -> list[float]:
    """Share of the policy's turns among 2,000, after each finding."""
    turns, found = Turns(0), []
    for arm, kind, grade in findings:
        turns.tell(arm, 100, [collision(judgement=judgement(grade, kind=kind))])
        found.append(sum(turns.draw() for _ in range(2000)) / 2000)
    return found


def test_turns_go_to_the_searcher_that_finds_what_is_new() -> None:
    first, repeated, preventable = shares(
        (GUIDE, "one", Grade.PREVENTABLE), (OWN, "one", Grade.PREVENTABLE), (OWN, "another", Grade.PREVENTABLE)
    )
    unpreventable = shares((GUIDE, "one", Grade.PREVENTABLE), (OWN, "another", Grade.FULL_BRAKING))[-1]
    assert max(first, repeated) < unpreventable < preventable


@pytest.mark.parametrize(
    ("method", "searching", "frozen"),
    [
        ("risk-sac", DrivenBy.RANDOM, DrivenBy.POLICY),  # without a guide its first actions are random
        ("ddpg", DrivenBy.RANDOM, DrivenBy.POLICY),
        ("archive", DrivenBy.RANDOM, DrivenBy.RANDOM),  # nothing to breed from yet
        ("bo-only", DrivenBy.SCRIPT, DrivenBy.SCRIPT),
        ("random", DrivenBy.RANDOM, DrivenBy.RANDOM),
        ("no-adversary", None, None),
        ("iid-random", DrivenBy.RANDOM, DrivenBy.RANDOM),
        ("iid-undisturbed", None, None),
    ],
)
def test_each_method_says_what_drives_the_adversaries(
    method: RunMethod, searching: DrivenBy | None, frozen: DrivenBy | None
) -> None:
    subject = searchers(method, WarmStartConfig(episodes=0))
    for learning, expected in ((True, searching), (False, frozen)):
        subject.next(learning=learning).sampler.ask()
        assert subject.driven_by(learning=learning) is expected


def test_the_policy_drives_in_the_scenes_of_its_own_archive_and_scripts_in_the_guides() -> None:
    wanted = spec("risk-sac-diverse", Budget(episodes=100), WarmStartConfig(episodes=3, failures=2), "dense")
    wanted = wanted.model_copy(
        update={"learner": wanted.learner.model_copy(update={"agent": AgentConfig(warmup_steps=0)})}
    )
    subject = Searchers(wanted, Problem.from_spec(wanted), observation_size=20, action_size=4)
    drove: dict[type, set[DrivenBy | None]] = {}
    struck = collision(judgement=judgement())
    for index in range(60):
        searcher = subject.next(learning=True)
        point = searcher.sampler.ask()
        drove.setdefault(type(searcher.actor), set()).add(subject.driven_by(learning=True))
        subject.tell(point, 0.0, Encounter(collision=struck))
        subject.add(episode_record(index, Outcome.FAILURE, collision=struck))
    assert drove.pop(ScriptFollower) == {DrivenBy.MODEL, DrivenBy.RANDOM, DrivenBy.SCRIPT}
    assert drove == {PretrainedLearner: {DrivenBy.POLICY}}


def test_the_frozen_policy_is_on_its_own() -> None:
    subject = searchers("risk-sac-diverse", WarmStartConfig(), "dense")
    assert type(subject.next(learning=False).actor) is PretrainedLearner


def test_a_search_ends_when_its_processor_time_is_spent_and_is_then_evaluated(tmp_path: Path) -> None:
    budget = Budget(episodes=50, evaluation_episodes=2, cpu_s=0.1)  # enough for an episode or two
    records = played(tmp_path, spec("random", budget))
    phases = [record.phase for record in records]
    assert phases[-2:] == ["evaluation", "evaluation"]
    assert 0 < phases.count("search") < 50
    assert len(phases) == phases.count("search") + 2
    assert records == played(tmp_path, spec("random", budget))  # told again, and not gone on with


def test_processor_time_does_not_cut_off_the_least_episodes(tmp_path: Path) -> None:
    budget = Budget(episodes=50, least_episodes=6, cpu_s=0.1)  # which the third episode at the latest has spent
    assert len(played(tmp_path, spec("random", budget))) == 6


def test_without_a_prior_scripts_are_bred_and_the_control_is_refused() -> None:
    cold = spec("risk-sac-diverse", Budget(episodes=100)).model_copy(update={"prior": "none"})
    subject = Searchers(cold, Problem.from_spec(cold), observation_size=20, action_size=4)
    assert type(subject.next(learning=True).sampler) is ArchiveOptimizer
    control = cold.model_copy(update={"method": "archive-replay"})
    with pytest.raises(ConfigError, match="none, and the method archive-replay"):
        Searchers(control, Problem.from_spec(control), observation_size=20, action_size=4)


HEAVY = {"torch", "botorch", "gpytorch", "pandas", "matplotlib", "fastapi", "sqlalchemy", "jinja2", "httpx"}
HEAVY |= {"risk_sac.client", "risk_sac.report.trend"}  # of other commands


def test_a_search_without_learning_loads_neither_torch_nor_pictures(tmp_path):
    code = (
        "import sys, runpy\n"
        "try: runpy.run_module('risk_sac', run_name='__main__')\n"
        f"finally: print(sorted({HEAVY} & set(sys.modules)))"
    )
    command = ["run", "--scenario", "low", "--method", "archive", "--episodes", "2", "--out", str(tmp_path / "run")]
    done = subprocess.run([sys.executable, "-c", code, *command], capture_output=True, text=True, check=True)
    assert (tmp_path / "run" / "checkpoint").exists()
    assert done.stdout.splitlines()[-1] == "[]"
