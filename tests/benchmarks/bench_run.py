"""Time of a run outside simulator and learner: next to nothing."""

import time
from collections.abc import Callable
from functools import wraps

import pytest

from risk_sac.config import Budget, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.execution.evaluate import run
from risk_sac.execution.recorder import Recorder
from risk_sac.records import RunMetrics
from risk_sac.scenario.families import FAMILIES
from risk_sac.search.agents.learner import Learner
from risk_sac.search.run import RunState
from risk_sac.search.scene_optimizer import BotorchOptimizer

WARM_UP, EPISODES = 1, 299  # a run of the usual length, but for what its first episode compiles and loads
LIMIT = 0.18  # asks are 11 % of a run, since a learner updates once per decision
PARTS = {
    "simulator": ((RiskSacEnv, "reset"), (RiskSacEnv, "step")),
    "learner": ((Learner, "act"), (Learner, "observe"), (Learner, "update")),
    "scene optimiser": ((BotorchOptimizer, "ask"), (BotorchOptimizer, "tell")),
    "everything else": ((RunState, "save"), (Recorder, "episode")),  # and what is in none of these
}


class Stopwatch:
    """Processor time of each method, from the moment of `begin`."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.seconds: dict[str, dict[str, float]] = {part: {} for part in PARTS}
        for part, methods in PARTS.items():
            for owner, name in methods:
                patch.setattr(owner, name, self._timed(self.seconds[part], getattr(owner, name)))

    def begin(self, episodes: int, metrics: RunMetrics | None) -> None:
        """An observer's progress, heard once the warm-up is over."""
        if episodes == WARM_UP:
            self.started = time.process_time()
            for seconds in self.seconds.values():
                seconds.update(dict.fromkeys(seconds, 0.0))

    def stop(self) -> None:
        self.total = time.process_time() - self.started

    def share(self, *parts: str) -> float:
        return sum(sum(self.seconds[part].values()) for part in parts) / self.total

    def of(self, part: str) -> str:
        return ", ".join(f"{name} {seconds / self.total:.1%}" for name, seconds in self.seconds[part].items())

    @staticmethod
    def _timed(seconds: dict[str, float], call: Callable[..., object]) -> Callable[..., object]:
        name = call.__name__
        seconds[name] = 0.0

        @wraps(call)
        def timed(*args: object, **kwargs: object) -> object:
            started = time.process_time()
            try:
                return call(*args, **kwargs)
            finally:
                seconds[name] += time.process_time() - started

        return timed


@pytest.mark.bench
@pytest.mark.timeout(900)
@pytest.mark.parametrize("family", FAMILIES)
def test_little_of_a_run_lies_outside_simulator_and_learner(family, tmp_path, monkeypatch):
    spec = RunSpec(family=family, method="risk-sac", seed=0, budget=Budget(episodes=WARM_UP + EPISODES))
    watch = Stopwatch(monkeypatch)
    run(spec, tmp_path / "run", watch.begin)
    watch.stop()
    overhead = 1.0 - watch.share("simulator", "learner")
    rest = overhead - watch.share("scene optimiser")
    print(
        f"\n{family}, risk-sac, {EPISODES} episodes after the warm-up in {watch.total:.0f} s: "
        f"simulator {watch.share('simulator'):.1%} ({watch.of('simulator')}); "
        f"learner {watch.share('learner'):.1%} ({watch.of('learner')}); "
        f"scene optimiser {watch.share('scene optimiser'):.1%} ({watch.of('scene optimiser')}); "
        f"everything else {rest:.1%} ({watch.of('everything else')}); "
        f"outside simulator and learner {overhead:.1%}"
    )
    assert overhead <= LIMIT
