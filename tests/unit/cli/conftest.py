import pytest

from risk_sac.config import Budget, RunSpec
from risk_sac.execution.evaluate import run
from risk_sac.records import RunMetrics

SPEC = RunSpec(family="low", method="random", seed=11, budget=Budget(episodes=3))


def ignore(done: int, metrics: RunMetrics | None) -> None:
    pass


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A finished run with at least one contact."""
    for seed in range(11, 31):
        folder = tmp_path_factory.mktemp("run")
        spec = SPEC.model_copy(update={"seed": seed, "budget": Budget(episodes=8)})
        if run(spec, folder, ignore).failures:
            return folder
    raise AssertionError("no contact in 160 random episodes; wanted one to list and draw")
