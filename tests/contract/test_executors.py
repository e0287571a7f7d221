import queue
from collections.abc import Iterator

import pytest

from risk_sac.errors import ConfigError
from risk_sac.execution import executor_named
from risk_sac.execution.executor import MakeExecutor, WorkerProgram
from risk_sac.execution.jobs import worker_program
from risk_sac.execution.ray.executor import RayExecutor
from tests.contract.executor_contract import ExecutorContract
from tests.ray_cluster import Cluster, needs_ray, running


class TestLocal(ExecutorContract):
    @pytest.fixture
    def make(self) -> MakeExecutor:
        return executor_named("local")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with running(tmp_path_factory.mktemp("cluster")) as cluster:
        yield cluster


class Reused(RayExecutor):
    """Executor for all tests: another Ray client costs seconds of a processor."""

    def begin_anew(self, program: WorkerProgram) -> "Reused":
        self._program, self._messages, self._orders = program, queue.SimpleQueue(), {}
        return self

    def close(self) -> None:
        """The module does it."""

    def really_close(self) -> None:
        super().close()


@pytest.fixture(scope="module")
def reused(cluster: Cluster) -> Iterator[Reused]:
    executor = Reused(worker_program())
    yield executor
    executor.really_close()


@needs_ray
class TestRay(ExecutorContract):
    @pytest.fixture
    def make(self, reused: Reused) -> MakeExecutor:
        return reused.begin_anew


def test_an_executor_that_does_not_exist_is_named_with_those_that_do():
    with pytest.raises(ConfigError, match="got 'cloud'; wanted one of local, ray") as caught:
        executor_named("cloud")
    assert caught.value.field == "RISK_SAC_EXECUTOR"
