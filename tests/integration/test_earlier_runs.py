"""Earlier runs: those of the command line opened in the service, and campaigns that go on from one."""

import hashlib
import shutil
from pathlib import Path
from typing import Any

import httpx
import pytest

from risk_sac import cli
from risk_sac.run_folder.results import read_results
from tests.earlier_runs import run_folder
from tests.server import Service


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


def refusal(client: httpx.Client, **changes: Any) -> str:
    """What is wrong with a prior."""
    answer = client.post("/v1/campaigns/check", json={"families": ["low"], "methods": ["archive-replay"]} | changes)
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert error["field"] == "prior", answer.text
    assert "\n" not in answer.json()["detail"]
    return str(answer.json()["detail"])


def test_a_campaign_goes_on_from_an_earlier_one(shared: Service) -> None:
    service = shared
    client, budget = service.client, {"budget": {"episodes": 2}}
    first, silent = (
        client.post("/v1/campaigns", json={"families": ["low"], "methods": [method]} | budget).json()["id"]
        for method in ("archive", "random")
    )
    assert "which is" in refusal(client, prior=first)  # not ended
    for campaign in (first, silent):
        service.wait_until(lambda campaign=campaign: service.get(campaign)["state"] == "succeeded")
        run_folder(next((service.data_dir / "campaigns" / campaign).iterdir()), scripts=campaign == first)
    assert "whose runs are of low" in refusal(client, prior=first, families=["mixed"])
    assert "followed no scripts" in refusal(client, prior=silent)
    for unknown in ("nothing", "/etc", "..", "v1_0123456789ab"):
        assert "the id of a campaign" in refusal(client, prior=unknown)
    body = {"families": ["low"], "methods": ["archive-replay"], "prior": first} | budget
    second = client.post("/v1/campaigns", json=body).raise_for_status().json()["id"]
    spec = service.get(second, "/spec")
    assert spec["prior"].startswith(f"{first.lower().replace('-', '_')[:20]}")
    client.delete(f"/v1/campaigns/{first}").raise_for_status()
    service.wait_until(lambda: service.get(second)["state"] == "succeeded")
    assert client.post("/v1/campaigns/check", json=spec).status_code == 200  # the copy outlives its source
