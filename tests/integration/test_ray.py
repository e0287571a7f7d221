"""The command line and the service on a Ray cluster of two nodes, whose files go through an S3 of our own."""

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from risk_sac.scenario import library
from risk_sac.scenario.place import PLACES
from tests.integration.scripted_worker import DIES, ONCE, WAITS, WELL_BEHAVED
from tests.ray_cluster import ROOT, Cluster, free_port, needs_ray, running
from tests.server import servers

pytestmark = needs_ray
BUCKET = "risk-sac"
TINY = ["--methods", "random", "--seeds", "1", "--episodes", "3", "--verify", "0"]
LONG_S = 300


@pytest.fixture(scope="module")
def s3(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """What a client of it needs in its environment."""
    port = free_port()
    environment = {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_ACCESS_KEY_ID": "nobody",
        "AWS_SECRET_ACCESS_KEY": "nothing",
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    log = tmp_path_factory.mktemp("s3") / "log"
    with log.open("wb") as output:
        server = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)],
            stdout=output, stderr=output, env=os.environ | environment,
        )  # fmt: skip
    make = (
        "import fsspec, time\nfor _ in range(600):\n  try:\n    "
        f"fsspec.filesystem('s3').mkdir({BUCKET!r}); break\n  except OSError: time.sleep(0.1)"
    )
    try:
        subprocess.run([sys.executable, "-c", make], check=True, env=os.environ | environment, timeout=LONG_S)
        yield environment
    finally:
        server.kill()
        server.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory, s3: dict[str, str]) -> Iterator[Cluster]:
    storage = {"RISK_SAC_RAY_STORAGE": f"s3://{BUCKET}/runs", "RISK_SAC_RAY_LEASE_S": "10"}
    with running(tmp_path_factory.mktemp("cluster"), nodes=2, cpus=1, **s3, **storage) as cluster:
        yield cluster


@pytest.fixture
def serve(cluster: Cluster, tmp_path: Path) -> Iterator[object]:
    with servers(tmp_path) as start:
        yield start


def evaluated(folder: Path, families: list[str], **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "risk_sac", "evaluate", "--families", *families, *TINY, "--out", str(folder)],
        env=os.environ | environment, cwd=ROOT, capture_output=True, text=True, timeout=LONG_S, check=False,
    )  # fmt: skip


def digests(folder: Path) -> dict[str, str]:
    return {path.parent.name: json.loads(path.read_text())["digest"] for path in folder.glob("runs/*/results.json")}


def stored() -> list[str]:
    """What lies in the bucket."""
    code = f"import fsspec; print(*fsspec.filesystem('s3').find({BUCKET!r}), sep='\\n')"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=LONG_S)
    return shown.stdout.split()


def tasks(cluster: Cluster) -> list[psutil.Process]:
    """Processes of Ray that look after a run."""
    return [each for node in cluster.nodes for each, name in cluster.processes(node) if name.startswith("ray::run-")]


def wait_until(holds: Callable[[], object], seconds: float = LONG_S) -> None:
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.1)


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A place of a map, in a library that no node has."""
    monkeypatch.setenv("RISK_SAC_PLACES", str(tmp_path / "places"))
    place = PLACES.validate_json((ROOT / "sumo_nets" / "low" / "place.json").read_bytes())
    return library.keep(place, (ROOT / "sumo_nets" / place.net).read_bytes())


def test_a_comparison_comes_to_the_same_on_a_cluster_and_leaves_nothing_there(cluster, place, tmp_path):
    there = evaluated(tmp_path / "ray", ["low", place])
    assert there.returncode == 0, there.stderr
    here = evaluated(tmp_path / "local", ["low", place], RISK_SAC_EXECUTOR="local")
    assert here.returncode == 0, here.stderr
    assert len(digests(tmp_path / "local")) == 2
    assert digests(tmp_path / "ray") == digests(tmp_path / "local")
    for name in digests(tmp_path / "local"):
        files = {path.name for path in (tmp_path / "local" / "runs" / name).iterdir()}
        assert {path.name for path in (tmp_path / "ray" / "runs" / name).iterdir()} >= files - {".lock"}
    assert stored() == []
    wait_until(lambda: not list(cluster.scratch.glob("*")))


def test_a_worker_and_a_task_that_are_killed_are_replaced_from_the_checkpoint(serve, cluster):
    service = serve()
    campaign_id = service.post(seeds=[WELL_BEHAVED, ONCE + DIES, WAITS], budget={"episodes": 12})
    run = f"low-random-{WAITS}"
    service.wait_for(campaign_id, lambda seen: service.episodes(campaign_id, run) == list(range(10)))
    metrics = service.client.get("/metrics").text
    assert "risk_sac_cluster_connected 1.0" in metrics
    assert sum(line.startswith("risk_sac_node_alive{") and line.endswith(" 1.0") for line in metrics.splitlines()) == 2
    wait_until(lambda: len(tasks(cluster)) == 1)  # on a busy machine the other runs are at work for longer
    # The task goes, and with it go the worker that it looks after and the folder of that.
    (task,) = tasks(cluster)
    workers = [each for each in task.children() if "scripted_worker" in each.cmdline()]
    assert len(workers) == 1
    task.kill()
    assert psutil.wait_procs(workers, LONG_S)[1] == []
    wait_until(lambda: list(cluster.scratch.glob(f"{run}-2-*/{run}")))
    (folder,) = cluster.scratch.glob(f"{run}-2-*/{run}")
    (folder / "go-10").touch()
    campaign = service.wait(campaign_id)
    assert campaign["state"] == "succeeded", campaign
    for each in campaign["runs"]:
        assert service.episodes(campaign_id, each["id"]) == list(range(12))
    wait_until(lambda: not list(cluster.scratch.glob("*")))
    assert stored() == []


def test_what_a_hung_node_says_later_is_dropped(serve, cluster):
    service = serve(lease_s=600)
    campaign_id = service.post(seeds=[WAITS], budget={"episodes": 12})
    run = f"low-random-{WAITS}"
    service.wait_for(campaign_id, lambda seen: service.episodes(campaign_id, run) == list(range(10)))
    (task,) = tasks(cluster)
    hung = [task, *(each for each in task.children() if "scripted_worker" in each.cmdline())]
    (old,) = cluster.scratch.glob(f"{run}-1-*/{run}")
    for process in hung:
        process.suspend()
    service.wait_for(campaign_id, lambda seen: seen["runs"][0]["attempts"] == 2)
    wait_until(lambda: list(cluster.scratch.glob(f"{run}-2-*/{run}")))
    (folder,) = cluster.scratch.glob(f"{run}-2-*/{run}")
    (old / "go-10").touch()  # it would go on now
    for process in hung:
        with contextlib.suppress(psutil.NoSuchProcess):
            process.resume()
    assert psutil.wait_procs(hung[1:], LONG_S)[1] == []
    assert service.episodes(campaign_id, run) == list(range(10))
    (folder / "go-10").touch()
    assert service.wait(campaign_id)["state"] == "succeeded"
    assert service.episodes(campaign_id, run) == list(range(12))


def test_a_bucket_that_is_not_there_is_told_before_the_first_run(cluster, tmp_path):
    shown = evaluated(tmp_path / "out", ["low"], RISK_SAC_RAY_STORAGE="s3://no-such-bucket/runs")
    assert shown.returncode == 2, shown.stderr
    text = " ".join(shown.stderr.split())
    assert "RISK_SAC_RAY_STORAGE" in text
    assert "this machine cannot use" in text
    assert not list(tmp_path.glob("out/runs/*"))
