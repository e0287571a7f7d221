"""Commands of the egos' walkthrough, as written, against the real service."""

import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from risk_sac.failures.bundle import read_bundle
from risk_sac.run_folder.results import read_results
from risk_sac.scenario.library import VARIABLE
from tests.maps import osm_town
from tests.ports import free_port

ROOT = Path(__file__).parents[2]
EGOS = ROOT / "risk_sac" / "egos"
README, STORY = ((EGOS / name).read_text(encoding="utf-8") for name in ("README.md", "walkthrough.md"))
EPISODES = 40

PATIENCE_S = 900.0  # with a machine that is busy

needs_tools = pytest.mark.skipif(
    "CI" not in os.environ and not all(map(shutil.which, ("bash", "curl", "jq"))), reason="needs bash, curl and jq"
)


@dataclass(frozen=True)
class Told:
    """What the story's commands left."""

    folder: Path
    url: str  # of the service, which goes on
    printed: str


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.M | re.S)


def command(folder: Path, name: str, arguments: str) -> None:
    """A command as an installation would have it on the path."""
    file = folder / name
    file.write_text(f'#!/bin/sh\nexec "{sys.executable}" {arguments} "$@"\n')
    file.chmod(0o755)


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Told]:
    folder = tmp_path_factory.mktemp("story")
    tools = folder / "bin"
    tools.mkdir()
    command(tools, "python", "")
    command(tools, "risk-sac", "-m risk_sac")
    (folder / "my_egos.py").write_text(blocks(README, "python")[0])
    (folder / "town.osm").write_text(osm_town())
    port = free_port()
    script = "\n".join(blocks(STORY, "sh")).replace(":8000", f":{port}").replace("--port 8000", f"--port {port}")
    script = script.replace("127.0.0.1:50051", f"127.0.0.1:{free_port()}")
    environment = os.environ | {
        "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]),
        "RISK_SAC_URL": f"http://localhost:{port}",
        VARIABLE: str(folder / "library"),
        "COLUMNS": "200",
    }
    with (folder / "log").open("wb") as log:
        shell = subprocess.Popen(
            ["bash", "-euo", "pipefail", "-c", script],
            **{"cwd": folder, "env": environment, "stdout": log, "stderr": log, "start_new_session": True},
        )
        try:
            status = shell.wait(PATIENCE_S)
            printed = (folder / "log").read_text(errors="replace")
            assert status == 0, printed[-4000:]
            yield Told(folder, f"http://localhost:{port}", printed)
        finally:
            os.killpg(shell.pid, signal.SIGKILL)  # ego and service, which the shell has left behind


@needs_tools
def test_the_service_has_failures_of_this_ego_on_this_map(told: Told) -> None:
    version = tomllib.loads((told.folder / "egos.toml").read_text())["pilot"]["version"]
    with httpx.Client(base_url=told.url, timeout=120) as client:
        (campaign,) = client.get("/v1/campaigns").raise_for_status().json()["items"]
        home = f"/v1/campaigns/{campaign['id']}"
        spec = client.get(f"{home}/spec").raise_for_status().json()
        results = client.get(f"{home}/results").raise_for_status().json()
        failures = client.get(f"{home}/failures").raise_for_status().json()["items"]
    assert campaign["state"] == "succeeded"
    assert spec["families"][0].startswith("car_following_")
    assert (spec["ego"]["driver"], spec["ego"]["version"]) == ("pilot", version)
    (run,) = results["runs"]
    assert run["metrics"]["episodes"] == EPISODES
    assert run["metrics"]["invalid"] == 0
    assert run["metrics"]["failures"] == len(failures) > 0
    repetitions = [failure["repetition"] for failure in failures if failure["repetition"]]
    assert repetitions, "no failure was replayed by the service"
    assert all(each["times"] == each["same"] for each in repetitions)


@needs_tools
def test_a_failure_is_drawn_and_stands_alone(told: Told) -> None:
    for picture in ("places.png", "failure.png", "twin.png"):
        assert (told.folder / picture).read_bytes().startswith(b"\x89PNG"), picture
    assert "every array is as recorded" in told.printed


@needs_tools
def test_the_same_without_a_server(told: Told, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    results = read_results(told.folder / "results" / "town")
    assert results.metrics.failures > 0
    assert re.search(r"([1-9]\d*) of \1 failures? repeat", told.printed), told.printed[-2000:]
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setenv("RISK_SAC_EGOS", str(told.folder / "egos.toml"))
    manifest = read_bundle(told.folder / "failure.npz").manifest
    assert manifest.spec.ego.driver == "pilot"
    assert manifest.spec.ego == results.spec.ego
    assert manifest.episode.collision.valid
