"""Command line and service on a Ray cluster of two nodes."""

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import psutil
import pytest

from risk_sac.errors import ConfigError
from risk_sac.execution.jobs import LOG, worker_program
from risk_sac.execution.ray.executor import RayExecutor
from risk_sac.scenario import library
from risk_sac.scenario.reading import shipped_document
from tests.integration.scripted_worker import DIES, ONCE, WAITS
from tests.ray_cluster import LONG_S, ROOT, Cluster, needs_ray, running, wait_until
from tests.server import servers

TINY = ["--methods", "random", "--seeds", "1", "--episodes", "3", "--verify", "0"]
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


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with running(tmp_path_factory.mktemp("cluster"), nodes=2, cpus=1, RISK_SAC_RAY_LEASE_S="10") as cluster:
        yield cluster


@pytest.fixture
def serve(cluster: Cluster, tmp_path: Path) -> Iterator[object]:
    with servers(tmp_path) as start:
        yield start


def evaluated(
    folder: Path, families: list[str], arguments: Sequence[str] = TINY, **environment: str
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "risk_sac", "evaluate", "--scenario", *families, *arguments, "--out", str(folder)],
        env=os.environ | environment, cwd=ROOT, capture_output=True, text=True, timeout=LONG_S, check=False,
    )  # fmt: skip


def digests(folder: Path) -> dict[str, str]:
    return {path.parent.name: json.loads(path.read_text())["digest"] for path in folder.glob("runs/*/results.json")}


def actors(cluster: Cluster, kind: str = "Attendant") -> list[psutil.Process]:
    """Ray's processes that attend a run, or one of its rollouts."""
    processes = [process for node in cluster.nodes for process in cluster.processes(node)]
    return [process for process, name in processes if name.startswith(f"ray::{kind}")]


def folder_beside(cluster: Cluster, run: str, *others: Path) -> Path:
    """Where the next attempt at a run works."""
    found: list[Path] = []

    def there() -> bool:
        found[:] = [each for each in cluster.scratch.glob(f"*/{run}") if each not in others]
        return len(found) == 1

    wait_until(there)
    return found[0]


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A scenario with its net, in a library that no node has."""
    monkeypatch.setenv("RISK_SAC_PLACES", str(tmp_path / "places"))
    document = shipped_document("low").model_copy(update={"network": "net.xml"})
    return library.keep(document, {"net.xml": (ROOT / "sumo_nets" / "low" / "low.net.xml").read_bytes()})


@needs_ray
def test_a_comparison_comes_to_the_same_on_a_cluster_and_leaves_nothing_there(cluster, place, tmp_path):
    there = evaluated(tmp_path / "ray", [place])
    assert there.returncode == 0, there.stderr
    here = evaluated(tmp_path / "local", [place], RISK_SAC_EXECUTOR="local")
    assert here.returncode == 0, here.stderr
    assert len(digests(tmp_path / "local")) == 1
    assert digests(tmp_path / "ray") == digests(tmp_path / "local")
    for name in digests(tmp_path / "local"):
        files = {path.name for path in (tmp_path / "local" / "runs" / name).iterdir()}
        assert {path.name for path in (tmp_path / "ray" / "runs" / name).iterdir()} >= files - {".lock"}
    wait_until(lambda: not list(cluster.scratch.glob("*")))


@needs_ray
def test_rounds_are_played_on_several_nodes_and_a_killed_actor_is_replaced(cluster, tmp_path):
    rounds = ["--methods", "archive", "--seeds", "1", "--episodes", "96", "--batch", "4", "--verify", "0"]
    log, killed = tmp_path / "ray" / "runs" / "low-archive-0" / LOG, []

    def lost() -> bool:
        """Kills the run's actors until one dies while it plays."""
        for actor in actors(cluster, "RolloutAttendant"):
            with contextlib.suppress(psutil.NoSuchProcess):
                if actor not in killed and actor.children():
                    actor.kill()
                    killed.append(actor)
        return log.exists() and b"a process elsewhere was lost in episode" in log.read_bytes()

    command = [sys.executable, "-m", "risk_sac", "evaluate", "--scenario", "low", *rounds]
    there = subprocess.Popen([*command, "--out", str(tmp_path / "ray")], cwd=ROOT)
    try:
        wait_until(lost)
        wait_until(lambda: any(actor.children() for actor in actors(cluster, "RolloutAttendant")))
        assert there.wait(LONG_S) == 0
    finally:
        there.kill()
        there.wait()
    here = evaluated(tmp_path / "local", ["low"], rounds, RISK_SAC_EXECUTOR="local", RISK_SAC_ROLLOUTS="1")
    assert here.returncode == 0, here.stderr
    assert digests(tmp_path / "ray") == digests(tmp_path / "local")
    wait_until(lambda: not list(cluster.scratch.glob("*")))


@needs_ray
def test_a_worker_and_an_actor_that_are_killed_are_replaced_from_the_checkpoint(serve, cluster):
    service = serve()
    campaign_id = service.post(seeds=[ONCE + DIES, WAITS], budget={"episodes": 12})
    run = f"low-random-{WAITS}"
    service.wait_for(campaign_id, lambda seen: service.episodes(campaign_id, run) == list(range(10)))
    metrics = service.client.get("/metrics").text
    assert "risk_sac_cluster_connected 1.0" in metrics
    assert sum(line.startswith("risk_sac_node_alive{") and line.endswith(" 1.0") for line in metrics.splitlines()) == 2
    wait_until(lambda: len(actors(cluster)) == 1)  # on a busy machine the other run is at work for longer
    # The actor goes, and with it go its worker and the folder of that.
    (actor,) = actors(cluster)
    workers = [each for each in actor.children() if "scripted_worker" in each.cmdline()]
    assert len(workers) == 1
    old = folder_beside(cluster, run)
    actor.kill()
    assert psutil.wait_procs(workers, LONG_S)[1] == []
    (folder_beside(cluster, run, old) / "go-10").touch()
    campaign = service.wait(campaign_id)
    assert campaign["state"] == "succeeded", campaign
    for each in campaign["runs"]:
        assert service.episodes(campaign_id, each["id"]) == list(range(12))
    wait_until(lambda: not list(cluster.scratch.glob("*")))


@needs_ray
def test_what_a_hung_node_says_later_is_dropped(serve, cluster):
    service = serve(lease_s=600)
    campaign_id = service.post(seeds=[WAITS], budget={"episodes": 12})
    run = f"low-random-{WAITS}"
    service.wait_for(campaign_id, lambda seen: service.episodes(campaign_id, run) == list(range(10)))
    (actor,) = actors(cluster)
    hung = [actor, *(each for each in actor.children() if "scripted_worker" in each.cmdline())]
    old = folder_beside(cluster, run)
    for process in hung:
        process.suspend()
    service.wait_for(campaign_id, lambda seen: seen["runs"][0]["attempts"] == 2)
    folder = folder_beside(cluster, run, old)
    with contextlib.suppress(FileNotFoundError):
        (old / "go-10").touch()  # it would go on now
    for process in hung:
        with contextlib.suppress(psutil.NoSuchProcess):
            process.resume()
    assert psutil.wait_procs(hung[1:], LONG_S)[1] == []
    assert service.episodes(campaign_id, run) == list(range(10))
    (folder / "go-10").touch()
    assert service.wait(campaign_id)["state"] == "succeeded"
    assert service.episodes(campaign_id, run) == list(range(12))


def path_with(*folders: Path) -> dict[str, str]:
    """An environment in which these folders come before what is installed."""
    return {"PYTHONPATH": os.pathsep.join([*map(str, folders), str(ROOT), os.environ.get("PYTHONPATH", "")])}


@pytest.mark.parametrize(
    "command",
    [["risk_sac", "evaluate", "--scenario", "low", *TINY, "--out", "out"], ["service"]],
    ids=lambda command: command[0],
)
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
