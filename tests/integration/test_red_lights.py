"""Every method finds an ego that ignores red lights."""

from pathlib import Path

import pytest

from risk_sac.config import METHODS, Budget, EgoConfig, RunSpec
from risk_sac.loop import execute_run
from risk_sac.records import EpisodeRecord, RunMetrics, SeriesFile

RED = "no_red_light_entry"


class UntilFound:
    """Stops a run after the first episode in which the ego entered on red."""

    found: EpisodeRecord | None = None

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        if RED in record.failed:
            assert series is not None
            assert metrics.requirements[RED].valid == 1
            self.found = record

    def should_stop(self) -> bool:
        return self.found is not None


@pytest.mark.usefixtures("steering_egos")
@pytest.mark.parametrize("method", [method for method in METHODS if METHODS[method].prior != "policy"])
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
