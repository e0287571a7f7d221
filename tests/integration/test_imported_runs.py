"""Runs of the command line, opened in the service."""

import hashlib
import shutil
from pathlib import Path

import pytest

from risk_sac import cli
from risk_sac.run_folder.results import read_results


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a finished run that has contacts."""
    root = tmp_path_factory.mktemp("runs")
    command = ["run", "--family", "low", "--method", "archive", "--seed", "3", "--episodes", "16"]
    assert cli.main([*command, "--out", str(root / "mine")]) == 0
    return root


def digest(root: Path) -> str:
    found = hashlib.sha256()
    for file in sorted(root.rglob("*")):
        found.update(str(file.relative_to(root)).encode() + (file.read_bytes() if file.is_file() else b""))
    return found.hexdigest()


def test_runs_of_the_command_line_are_campaigns_that_have_ended(serve, runs):
    before, stored = digest(runs), read_results(runs / "mine")
    service = serve("risk_sac.execution.worker", runs=runs)
    (campaign,) = service.client.get("/v1/campaigns").json()["items"]
    assert (campaign["state"], campaign["label"]) == ("succeeded", "mine")
    (run,) = service.get(campaign["id"], "/results")["runs"]
    assert (run["digest"], run["metrics"]["ecr"]) == (stored.digest, stored.metrics.ecr)
    found = service.get(campaign["id"], "/failures", tier="raw", limit=100)["items"]
    assert [each["id"] for each in found] == [each.id for each in stored.failures]
    failure = service.get(campaign["id"], f"/failures/{found[0]['id']}")
    assert len(failure["series"]["time_s"]) > failure["steps"]

    assert f"the page is at http://127.0.0.1:{service.port}/page/" in service.log.read_text()
    service.stop()
    service.start()
    assert len(service.client.get("/v1/campaigns").json()["items"]) == 1
    assert digest(runs) == before


def test_a_folder_without_a_run_is_named(serve, tmp_path):
    with pytest.raises(AssertionError, match="which holds no run"):
        serve("risk_sac.execution.worker", runs=tmp_path / "nothing")


def test_a_damaged_run_is_not_played_in_the_place_of_its_import(serve, runs, tmp_path):
    shutil.copytree(runs / "mine", tmp_path / "damaged")
    for series in (tmp_path / "damaged").rglob("*.npz"):
        series.unlink()
    service = serve("risk_sac.execution.worker", runs=tmp_path)
    (campaign,) = service.client.get("/v1/campaigns").json()["items"]
    assert campaign["state"] == "cancelled"
    assert "is not imported" in service.log.read_text()
