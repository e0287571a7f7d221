"""Earlier runs: command-line folders in the service, and campaigns that continue one."""

import hashlib
import os
import shutil
import signal
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from risk_sac import cli
from risk_sac.metrics import results_digest
from risk_sac.run_folder.results import (
    EPISODES,
    FAILURES,
    RecordedFailure,
    read_results,
    records_from_lines,
    series_name,
    write_results,
)
from tests.earlier_runs import run_folder
from tests.server import Service


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a finished run that has contacts."""
    root = tmp_path_factory.mktemp("runs")
    command = ["run", "--scenario", "low", "--method", "archive", "--seed", "3", "--episodes", "16"]
    assert cli.main([*command, "--out", str(root / "mine")]) == 0
    return root


@pytest.fixture
def root(tmp_path: Path) -> Iterator[Path]:
    """Folder for runs, removed at the end since a FIFO would block."""
    yield tmp_path / "runs"
    shutil.rmtree(tmp_path / "runs")


def repeated(source: Path, out: Path, times: int) -> int:
    """Writes a run that repeats another's episodes; returns how many."""
    results = read_results(source)
    one = records_from_lines((source / EPISODES).read_bytes())
    records = [each.model_copy(update={"index": i}) for i, each in enumerate(one * times)]
    (out / FAILURES).mkdir(parents=True)
    for i, record in enumerate(records):
        if record.worst_violation is not None:
            os.link(source / FAILURES / series_name(one[i % len(one)].index), out / FAILURES / series_name(i))
    budget = results.spec.budget.model_copy(update={"episodes": len(records)})
    spec = results.spec.model_copy(update={"budget": budget})
    failures = tuple(RecordedFailure.of(spec.id, each) for each in records if each.worst_violation is not None)
    told = {"spec": spec, "spec_digest": spec.digest, "digest": results_digest(records), "failures": failures}
    write_results(out, replace(results, **told))
    (out / EPISODES).write_text("".join(f"{each.model_dump_json()}\n" for each in records))
    return len(records)


def digest(root: Path) -> str:
    found = hashlib.sha256()
    for file in sorted(root.rglob("*")):
        found.update(str(file.relative_to(root)).encode() + (file.read_bytes() if file.is_file() else b""))
    return found.hexdigest()


def campaigns(service: Service) -> list[dict[str, Any]]:
    return service.client.get("/v1/campaigns").json()["items"]


def imported(service: Service) -> dict[str, Any]:
    """The one campaign, once it has ended."""
    service.wait_until(lambda: len(campaigns(service)) == 1)
    return service.wait(campaigns(service)[0]["id"])


def test_runs_of_the_command_line_are_campaigns_that_have_ended(serve, runs):
    before, stored = digest(runs), read_results(runs / "mine")
    service = serve("risk_sac.execution.worker", runs=runs)
    campaign = imported(service)
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
    assert [each["id"] for each in campaigns(service)] == [campaign["id"]]
    assert digest(runs) == before


def test_a_folder_without_a_run_is_named(serve, tmp_path):
    with pytest.raises(AssertionError, match="which holds no run"):
        serve("risk_sac.execution.worker", runs=tmp_path / "nothing")


def test_of_a_damaged_run_nothing_is_left(serve, runs, tmp_path):
    shutil.copytree(runs / "mine", tmp_path / "damaged")
    for series in (tmp_path / "damaged").rglob("*.npz"):
        series.unlink()
    service = serve("risk_sac.execution.worker", runs=tmp_path)
    service.wait_until(lambda: "damaged is not imported" in service.log.read_text())
    assert campaigns(service) == []
    assert list((service.data_dir / "campaigns").iterdir()) == []


def at_work(service: Service, total: int) -> Iterator[Mapping[str, Any]]:
    for campaign in campaigns(service):
        if campaign["state"] == "running" and 0 < campaign["progress"]["episodes_done"] < total:
            yield campaign


def test_an_import_that_is_killed_is_begun_again_and_never_played(serve, runs, root):
    total = repeated(runs / "mine", root / "long", 150)
    service = serve("risk_sac.execution.worker", runs=root)
    service.wait_until(lambda: any(at_work(service, total)))  # it answers while it imports
    assert service.client.get("/readyz").status_code == 200
    (half,) = campaigns(service)
    service.stop(signal.SIGKILL)
    service.start()
    service.wait_until(lambda: [each["id"] for each in campaigns(service)] not in ([], [half["id"]]))
    campaign = imported(service)
    assert (campaign["state"], campaign["progress"]["episodes_done"]) == ("succeeded", total)
    assert [each.name for each in (service.data_dir / "campaigns").iterdir()] == [campaign["id"]]
    log = service.log.read_text()
    assert "its import was interrupted; it is removed" in log
    assert "interrupted runs go back to the queue" not in log
    assert [run["attempts"] for run in campaign["runs"]] == [1], "a worker was started"


def test_an_import_that_is_cancelled_ends(serve, runs, root):
    total = repeated(runs / "mine", root / "long", 150)
    service = serve("risk_sac.execution.worker", runs=root)
    service.wait_until(lambda: any(at_work(service, total)))
    (campaign,) = campaigns(service)
    service.client.post(f"/v1/campaigns/{campaign['id']}/cancel")
    assert service.wait(campaign["id"])["state"] == "cancelled"


def test_links_and_special_files_are_refused_by_name_and_the_others_imported(serve, runs, root):
    secret = root.with_name("secret")
    secret.mkdir()
    (secret / "key").write_text("TOP SECRET")
    for name in ("a link", "a linked folder", "a pipe", "a plain one", "no results"):
        shutil.copytree(runs / "mine", root / name)
    (root / "a link" / "worker.log").symlink_to(secret / "key")
    (root / "a linked folder" / "studies").symlink_to(secret)
    (root / "a pipe" / EPISODES).unlink()
    os.mkfifo(root / "a pipe" / EPISODES)
    (root / "no results" / "results.json").unlink()
    os.mkfifo(root / "no results" / "results.json")
    (root / "linked whole").symlink_to(runs / "mine")
    service = serve("risk_sac.execution.worker", runs=root)
    special = {
        "a link/worker.log": "a symbolic link",
        "a linked folder/studies": "a symbolic link",
        "a pipe/episodes.jsonl": "a FIFO",
        "linked whole": "a symbolic link",
        "no results/results.json": "a FIFO",
    }
    service.wait_until(lambda: service.log.read_text().count("is not imported") == len(special))
    assert (imported(service)["state"], imported(service)["label"]) == ("succeeded", "a plain one")
    for name, kind in special.items():
        assert f"got {root / name}, which is {kind}; wanted folders and plain files" in service.log.read_text()
    assert not any("SECRET" in file.read_text(errors="replace") for file in service.data_dir.rglob("*.log"))


def refusal(client: httpx.Client, **changes: Any) -> str:
    """What is wrong with a prior."""
    answer = client.post("/v1/campaigns/check", json={"families": ["low"], "methods": ["archive-replay"]} | changes)
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert error["field"] == "prior", answer.text
    assert "\n" not in answer.json()["detail"]
    return str(answer.json()["detail"])


def test_a_campaign_goes_on_from_an_earlier_one(shared):
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
