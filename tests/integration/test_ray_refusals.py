"""What is wrong with a cluster is told at the start, with the setting to blame."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from risk_sac.errors import ConfigError
from risk_sac.execution.jobs import worker_program
from risk_sac.execution.ray.executor import RayExecutor
from tests.ray_cluster import LONG_S, ROOT, Cluster, needs_ray, running

TINY = ["--scenario", "low", "--methods", "random", "--seeds", "1", "--episodes", "1", "--out", "out"]
# As if Ray were not installed, wherever it is.
WITHOUT_RAY = """
import sys
from importlib.machinery import PathFinder
class Without(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name.partition(".")[0] == "ray" else super().find_spec(name, path, target)
sys.meta_path[sys.meta_path.index(PathFinder)] = Without
"""


def path_with(*folders: Path) -> dict[str, str]:
    """An environment in which these folders come before what is installed."""
    return {"PYTHONPATH": os.pathsep.join([*map(str, folders), str(ROOT), os.environ.get("PYTHONPATH", "")])}


@pytest.mark.parametrize("command", [["risk_sac", "evaluate", *TINY], ["service"]], ids=lambda command: command[0])
def test_without_ray_the_setting_that_wants_it_is_named(command, tmp_path):
    (tmp_path / "sitecustomize.py").write_text(WITHOUT_RAY)
    settings = {"RISK_SAC_EXECUTOR": "ray", "RISK_SAC_DATA_DIR": str(tmp_path / "data"), "RISK_SAC_PORT": "1"}
    shown = subprocess.run(
        [sys.executable, "-m", *command], env=os.environ | path_with(tmp_path) | settings, cwd=tmp_path,
        capture_output=True, text=True, timeout=LONG_S, check=False,
    )  # fmt: skip
    assert shown.returncode != 0
    text = " ".join(shown.stderr.split())
    assert "RISK_SAC_EXECUTOR" in text
    assert "pip install risk-sac[ray]" in text
    assert not list(tmp_path.glob("out/runs/*"))


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with running(tmp_path_factory.mktemp("cluster"), nodes=1, cpus=1, RISK_SAC_RAY_LEASE_S="10") as cluster:
        yield cluster


def refusal() -> ConfigError:
    with pytest.raises(ConfigError) as caught:
        RayExecutor(worker_program()).close()
    return caught.value


@needs_ray
@pytest.mark.parametrize(
    ("environment", "field", "said"),
    [
        ({"RISK_SAC_RAY_ADDRESS": "127.0.0.1:1"}, "RISK_SAC_RAY_ADDRESS", "nothing answers"),
        ({"RISK_SAC_RAY_ADDRESS": "somewhere"}, "RISK_SAC_RAY_ADDRESS", "wanted `auto` or HOST:PORT"),
        ({"RISK_SAC_RAY_CPUS_PER_RUN": "3"}, "RISK_SAC_RAY_CPUS_PER_RUN", "no node of the cluster has as much"),
        ({"RISK_SAC_RAY_CPUS_PER_RUN": "none"}, "RISK_SAC_RAY_CPUS_PER_RUN", 'got "none"'),
        ({"RISK_SAC_RAY_SCRATCH_DIR": "/proc/runs"}, "RISK_SAC_RAY_SCRATCH_DIR", "cannot write to"),
        ({"RAY_AUTH_TOKEN": "0" * 32}, "RISK_SAC_RAY_ADDRESS", "with its token"),
    ],
)
def test_settings_that_cannot_work_are_named(cluster, monkeypatch, environment, field, said):
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    error = refusal()
    assert error.field == field
    assert said in str(error)
