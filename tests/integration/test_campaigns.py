"""Campaigns on a real server, with workers that do what the test needs."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest


def test_a_campaign_runs_to_its_end_and_can_be_read(serve):
    service = serve()
    first = service.post(label="first", seeds=[0, 1], budget={"episodes": 10})
    second = service.post(label="second", budget={"episodes": 4})
    moving = {service.get(first)["progress"]["episodes_done"]}
    while service.get(first)["state"] in ("queued", "running"):
        moving.add(service.get(first)["progress"]["episodes_done"])
    assert len(moving) > 3
    campaign = service.wait(first)
    assert campaign["state"] == "succeeded"
    assert campaign["progress"]["episodes_done"] == campaign["progress"]["episodes_total"] == 20
    assert campaign["progress"]["eta_s"] == 0
    assert service.wait(second)["state"] == "succeeded"
    assert [item["label"] for item in service.client.get("/v1/campaigns").json()["items"]] == ["second", "first"]
    results = service.get(first, "/results")
    assert results["complete"]
    assert [run["digest"] for run in results["runs"]] == ["d", "d"]
    assert results["totals"][0]["episodes"] == 20
    page = service.get(first, "/episodes", limit=15)
    rest = service.get(first, "/episodes", limit=15, cursor=page["next"])
    assert len({item["id"] for item in page["items"] + rest["items"]}) == 20
    assert rest["next"] is None
    assert service.get(first, "/failures", tier="raw")["items"] == []


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("DIES", "worker was killed by SIGKILL"),
        (
            "BABBLES",
            "worker wrote b\"Loading net-file from 'low.net.xml' ... done (3ms).\\n\" where an event was wanted",
        ),
        ("EXITS", "worker exited with status 1: Traceback: the policy is NaN"),
    ],
)
def test_a_worker_that_breaks_fails_its_run_and_nothing_else(serve, scripted, fault, reason):
    service = serve()
    campaign = service.wait(
        service.post(seeds=[getattr(scripted, fault), scripted.WELL_BEHAVED], budget={"episodes": 8})
    )
    broken, sibling = campaign["runs"]
    assert (broken["state"], broken["reason"]) == ("failed", reason)
    assert broken["episodes_done"] == 2
    assert (sibling["state"], sibling["episodes_done"]) == ("succeeded", 8)
    assert (campaign["state"], campaign["reason"]) == ("failed", f"run {broken['id']}: {reason}")
    assert service.wait(service.post(budget={"episodes": 1}))["state"] == "succeeded"


def test_cancel_stops_at_an_episode_and_keeps_what_was_found(serve):
    service = serve()
    campaign_id = service.post(seeds=[0, 1, 2], budget={"episodes": 1000})
    service.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] > 4)
    for _ in range(2):
        assert service.client.post(f"/v1/campaigns/{campaign_id}/cancel").status_code == 202
    campaign = service.wait(campaign_id)
    assert campaign["state"] == "cancelled"
    assert [run["state"] for run in campaign["runs"]] == ["cancelled"] * 3
    assert campaign["progress"]["episodes_done"] == len(service.get(campaign_id, "/episodes", limit=500)["items"]) > 4
    assert service.workers() == []
    assert service.client.post(f"/v1/campaigns/{campaign_id}/cancel").json() == campaign


def test_a_worker_that_ignores_the_cancel_is_killed_after_its_grace(serve, scripted):
    service = serve(grace_s=0.5)
    campaign_id = service.post(seeds=[scripted.HANGS], budget={"episodes": 1000})
    service.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] > 0)
    started = time.monotonic()
    assert service.client.post(f"/v1/campaigns/{campaign_id}/cancel").json()["state"] == "cancelling"
    assert service.wait(campaign_id)["state"] == "cancelled"
    assert 0.4 < time.monotonic() - started < 5
    assert service.workers() == []


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_restarted_server_goes_on_without_losing_or_repeating_an_episode(serve, number):
    service = serve()
    campaign_id = service.post(seeds=[0, 1, 2], budget={"episodes": 20})
    service.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] >= 10)
    service.stop(number)
    deadline = time.monotonic() + 5
    while service.workers():
        assert time.monotonic() < deadline, "a worker outlived its server"
        time.sleep(0.05)
    service.start()
    assert service.get(campaign_id)["progress"]["episodes_done"] >= 10
    campaign = service.wait(campaign_id)
    assert campaign["state"] == "succeeded"
    assert campaign["progress"]["episodes_done"] == 60
    for run in campaign["runs"]:
        assert sorted(service.episodes(campaign_id, run["id"])) == list(range(20))


def test_two_servers_never_share_a_data_folder(serve):
    service = serve()
    second = subprocess.run(
        [sys.executable, "-m", "service"],
        env=os.environ | {"RISK_SAC_DATA_DIR": str(service.data_dir), "RISK_SAC_PORT": "8999"},
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    assert second.returncode != 0
    assert "is in use by another process" in second.stderr


def test_the_server_process_loads_neither_torch_nor_libsumo():
    code = (
        "import json, sys; from service.app import create_app; from service.settings import ServiceSettings;"
        "create_app(ServiceSettings()).openapi(); print(json.dumps(sorted(sys.modules)))"
    )
    loaded = json.loads(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout)
    assert "service.manager" in loaded
    assert "risk_sac.report" in loaded
    assert not {"torch", "libsumo", "botorch", "gpytorch", "matplotlib.pyplot", "service.worker"} & set(loaded)


def test_a_disk_that_is_full_for_a_worker_stops_the_campaign_with_that_reason(serve, scripted):
    service = serve()
    campaign = service.wait(service.post(seeds=[scripted.DISK_FULL, scripted.WELL_BEHAVED], budget={"episodes": 1000}))
    assert (campaign["state"], campaign["reason"]) == ("failed", "storage failed: No space left on device")
    assert [run["state"] for run in campaign["runs"]] == ["failed", "failed"]
    assert service.get(campaign["id"], "/episodes")["items"]
    service.wait_until(lambda: service.workers() == [])
