from collections.abc import Iterator

import pytest

from service.settings import ServiceSettings
from tests.contract.serving import serving

pytest.register_assert_rewrite("tests.contract.executor_contract")


@pytest.fixture(scope="session")
def base_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with serving(ServiceSettings(data_dir=tmp_path_factory.mktemp("data"))) as url:
        yield url
