import pytest

from risk_sac.errors import ConfigError
from risk_sac.execution.executors import EXECUTORS, MakeExecutor, executor_named
from tests.contract.executor_contract import ExecutorContract


@pytest.mark.parametrize("name", EXECUTORS)
class TestEveryExecutor(ExecutorContract):
    @pytest.fixture
    def make(self, name: str) -> MakeExecutor:
        return executor_named(name)


def test_an_executor_that_does_not_exist_is_named_with_those_that_do():
    with pytest.raises(ConfigError, match="got 'cloud'; wanted one of local") as caught:
        executor_named("cloud")
    assert caught.value.field == "RISK_SAC_EXECUTOR"
