"""What the server process loads."""

import json
import subprocess
import sys

import pytest


@pytest.fixture(scope="module")
def loaded() -> set[str]:
    """Names of its modules."""
    code = (
        "import json, sys; from service.app import create_app; from service.settings import ServiceSettings;"
        "create_app(ServiceSettings()).openapi(); print(json.dumps(sorted(sys.modules)))"
    )
    return set(json.loads(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout))


def test_the_server_process_loads_nothing_that_learns_compiles_or_simulates_and_matplotlib_to_draw(
    loaded: set[str],
) -> None:
    assert "service.runs.manager" in loaded
    assert "risk_sac.report" in loaded
    assert not {"torch", "libsumo", "botorch", "gpytorch", "numba", "matplotlib", "risk_sac.execution.worker"} & loaded


def test_the_server_loads_nothing_of_a_cluster_that_it_does_not_use(loaded: set[str]) -> None:
    assert "risk_sac.execution.executor" in loaded
    assert not {"ray", "risk_sac.execution.ray.executor", "risk_sac.execution.ray.bridge"} & loaded


def test_the_server_reads_no_upload_itself(loaded: set[str]) -> None:
    assert "service.networks.sandbox" in loaded
    assert not [name for name in loaded if name.startswith("service.networks.checker")]
