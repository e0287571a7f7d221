"""Real violations without contact; all methods find egos that ignore red."""

from pathlib import Path

import numpy as np
import pytest

from risk_sac.config import METHODS, Budget, EgoConfig, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.records import EpisodeRecord, Grade, RunMetrics, SeriesFile, Violation
from risk_sac.search.loop import execute_run
from risk_sac.verdicts.evidence import ego_path
from risk_sac.verdicts.reference import History, placed

EPISODES = 12


def play(env: RiskSacEnv, seed: int, *, undisturbed: bool = False) -> tuple[Violation, ...]:
    rng = np.random.default_rng(seed)
    env.reset(seed=seed)
    for step in range(env.problem.family.horizon_steps):
        if step % 10 == 0:
            action = np.zeros(env.action_size) if undisturbed else rng.uniform(-1.0, 1.0, env.action_size)
        *_, terminated, truncated, _ = env.step(action.astype(np.float32))
        if terminated or truncated:
            break
    return env.violations(env.requirement_results())


@pytest.mark.usefixtures("steering_egos")
def test_an_ego_that_leaves_the_road_would_have_been_kept_on_it_by_its_lane() -> None:
    env = RiskSacEnv.of(RunSpec(family="low", method="random", seed=0, ego=EgoConfig(driver="off-roader")))
    found = [violation for seed in range(EPISODES) for violation in play(env, seed)]
    env.close()
    assert found
    assert {violation.requirement for violation in found} == {"on_carriageway"}
    assert {violation.grade for violation in found} == {Grade.PREVENTABLE}
    assert {violation.broke for violation in found} == {("off_road",)}
    assert all(violation.kind.startswith("carriageway left; ego ") for violation in found)


@pytest.mark.parametrize("family", ["low", "mixed", "dense"])
def test_what_the_ego_drove_is_measured_again_as_it_was(family: str) -> None:
    env = RiskSacEnv.of(RunSpec.model_validate({"family": family, "method": "random", "seed": 0}))
    play(env, 3, undisturbed=True)
    played = History(env.trace.frames, env.trace.measures, env.evidence())
    env.close()
    path = ego_path(played.evidence)
    gauge = env._gauge
    gauge.reset(gauge.carriageway)
    gauge.remember(played.frames[0], played.measures[0].signals)
    before = played.frames[0]
    for t in range(1, len(played.frames)):
        frame, seen = placed(played, path, path.s, t, frozenset(), before)
        again = gauge.measure(frame, before, seen).signals
        first = played.measures[t].signals
        # SUMO's drivers change their acceleration with every step, which positions tell less exactly.
        noisy = {"ego_jerk_mps3", "ego_braking_mps2"}
        wanted = {name: value for name, value in first.items() if name not in noisy}
        assert {name: again[name] for name in wanted} == pytest.approx(wanted, abs=0.3, rel=0.05), (t, frame.time_s)
        before = frame


RED = "no_red_light_entry"


class UntilFound:
    """Observer that stops a run once the ego has entered on red."""

    found: EpisodeRecord | None = None

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        if RED in record.failed:
            assert series is not None
            assert metrics.requirements[RED].valid == 1
            self.found = record

    def should_stop(self) -> bool:
        return self.found is not None


@pytest.mark.usefixtures("steering_egos")
@pytest.mark.parametrize(
    "method",
    [
        pytest.param(name, marks=() if name in ("random", "archive", "risk-sac") else pytest.mark.torture)
        for name, method in METHODS.items()
        if method.prior != "policy" and method.scenes != "boundary"
    ],
)
def test_every_method_finds_within_100_episodes_that_the_ego_enters_on_red(method: str, tmp_path: Path) -> None:
    spec = RunSpec(
        family="dense", method=method, seed=3, budget=Budget(episodes=100), ego=EgoConfig(driver="red-runner")
    )
    observer = UntilFound()
    execute_run(spec, tmp_path, observer)
    assert observer.found is not None
    violation = next(each for each in observer.found.violations if each.requirement == RED)
    assert violation.valid
    assert observer.found.steps == 150 or observer.found.collision is not None
