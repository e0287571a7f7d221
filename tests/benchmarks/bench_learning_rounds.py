"""Speed of rounds against single episodes, and the learner's share of it."""

import time
from pathlib import Path
from typing import NamedTuple

import pytest

from risk_sac.config import Budget, LearnerConfig, RunMethod, RunSpec
from risk_sac.config.learner import WarmStartConfig
from risk_sac.host.machine import ROLLOUTS, cores
from risk_sac.records import EpisodeRecord, RunMetrics, SeriesFile
from risk_sac.search.agents.learner import Learner
from risk_sac.search.loop import execute_run
from risk_sac.search.run import RunOutcome
from tests.listener import Listener

BATCH, TURNS = 8, 2
GUIDED, TO_WARM, MEASURED = 8, 24, 24  # episodes: of the guide, before the measurement, and measured


class Speed(NamedTuple):
    """What a part of a run took."""

    episodes: int
    wall_s: float
    cpu_s: float  # of all processes
    updates_s: float  # processor time of the learner's updates


class Meter(Listener):
    """Measures the episodes after the first `TO_WARM` ones."""

    def __init__(self, updates: list[float]) -> None:
        super().__init__()
        self.updates = updates

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        super().episode(record, metrics, series)
        if record.index == TO_WARM - 1:
            self.began_s, self.first_update = time.perf_counter(), len(self.updates)

    def speed(self, outcome: RunOutcome) -> Speed:
        spent = outcome.episode_cpu_s
        wall_s = time.perf_counter() - self.began_s
        return Speed(
            len(spent) - TO_WARM, wall_s, spent[-1] - spent[TO_WARM - 1], sum(self.updates[self.first_update :])
        )


@pytest.mark.bench
@pytest.mark.parametrize("method", ["archive", "risk-sac"])
def test_rounds_beside_one_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: RunMethod) -> None:
    """Alternates between both, because other work disturbs a machine for minutes."""
    updates: list[float] = []
    update = Learner.update

    def timed(learner: Learner) -> object:
        began_s = time.process_time()
        result = update(learner)
        updates.append(time.process_time() - began_s)
        return result

    monkeypatch.setattr(Learner, "update", timed)
    monkeypatch.delenv(ROLLOUTS, raising=False)
    learner = LearnerConfig(warm_start=WarmStartConfig(episodes=GUIDED))
    speeds: dict[int, list[Speed]] = {1: [], BATCH: []}
    for turn in range(TURNS):
        for batch, measured in speeds.items():
            meter, budget = Meter(updates), Budget(episodes=TO_WARM + MEASURED, batch=batch)
            spec = RunSpec(family="low", method=method, seed=3 + turn, budget=budget, learner=learner)
            measured.append(meter.speed(execute_run(spec, tmp_path / f"{turn}-{batch}", meter)))
    for batch, measured in speeds.items():
        episodes, wall_s, cpu_s, updates_s = map(sum, zip(*measured, strict=True))
        print(
            f"\n{method}, batch {batch}, {cores()} processors: {episodes / wall_s:.2f} episodes/s; "
            f"{cpu_s / episodes:.2f} s of processor time each, of which updates {updates_s / cpu_s:.0%}; "
            f"updates {updates_s / wall_s:.0%} of the wall time"
        )
    assert all(one.wall_s > 0.0 for measured in speeds.values() for one in measured)
