from collections.abc import Iterator
from contextlib import closing

import pytest

from risk_sac.errors import ConfigError
from risk_sac.execution.executor import MakeExecutor, executor_named
from risk_sac.execution.ray.executor import RayExecutor
from risk_sac.execution.ray.link import Link
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


@pytest.fixture(scope="module")
def link(cluster: Cluster) -> Iterator[Link]:
    """One for all tests: another client costs Ray, and them, several seconds of a processor."""
    with closing(Link()) as link:
        yield link


@needs_ray
class TestRay(ExecutorContract):
    @pytest.fixture
    def make(self, link: Link) -> MakeExecutor:
        return lambda program: RayExecutor(program, link)


def test_an_executor_that_does_not_exist_is_named_with_those_that_do():
    with pytest.raises(ConfigError, match="got 'cloud'; wanted one of local, ray") as caught:
        executor_named("cloud")
    assert caught.value.field == "RISK_SAC_EXECUTOR"
