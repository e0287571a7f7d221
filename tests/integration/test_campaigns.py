"""Campaigns on a real server, with workers scripted by the test."""

import os
import signal
import subprocess
import sys
import time

import pytest

from tests.server import LONG_S

DATABASES = ["sqlite", "postgresql"]
FIRST = ["sqlite", pytest.param("postgresql", marks=pytest.mark.torture)]
SQLITE_FIRST = pytest.mark.parametrize("serve", FIRST, indirect=True)
EACH_DATABASE_SHARED = pytest.mark.parametrize("serve_shared", DATABASES, indirect=True)
SQLITE_FIRST_SHARED = pytest.mark.parametrize("serve_shared", FIRST, indirect=True)


@pytest.fixture(scope="module")
def shared(serve_shared):
    """See `shared` of the conftest; here with little patience."""
    return serve_shared(attempts=3)


@EACH_DATABASE_SHARED
def test_a_campaign_runs_to_its_end_and_can_be_read(shared):
    service = shared
    first = service.post(label="first", seeds=[0, 1], budget={"episodes": 30})
    second = service.post(label="second", budget={"episodes": 4})
    moving = {service.get(first)["progress"]["episodes_done"]}
    while service.get(first)["state"] in ("queued", "running"):
        time.sleep(0.05)
        moving.add(service.get(first)["progress"]["episodes_done"])
    assert moving - {0, 60}, "no progress was seen"
    campaign = service.wait(first)
    assert campaign["state"] == "succeeded"
    assert campaign["progress"]["episodes_done"] == campaign["progress"]["episodes_total"] == 60
    assert campaign["progress"]["eta_s"] == 0
    assert service.wait(second)["state"] == "succeeded"
    assert [item["label"] for item in service.client.get("/v1/campaigns").json()["items"][:2]] == ["second", "first"]
    results = service.get(first, "/results")
    assert results["complete"]
    assert [run["digest"] for run in results["runs"]] == ["d", "d"]
    assert results["totals"][0]["episodes"] == 60
    page = service.get(first, "/episodes", limit=35)
    rest = service.get(first, "/episodes", limit=35, cursor=page["next"])
    assert len({item["id"] for item in page["items"] + rest["items"]}) == 60
    assert rest["next"] is None
    assert service.get(first, "/failures", tier="raw")["items"] == []


@pytest.fixture(scope="module")
def broken(shared, scripted):
    """Campaign with runs whose workers break repeatedly, and one sound run."""
    faults = [scripted.DIES, scripted.BABBLES, scripted.EXITS]
    return shared.wait(shared.post(seeds=[*faults, scripted.WELL_BEHAVED], budget={"episodes": 8}))


@SQLITE_FIRST_SHARED
def test_a_run_whose_workers_break_in_a_row_fails_and_nothing_else(shared, broken):
    *failed, sibling = broken["runs"]
    babble = "Loading net-file from 'low.net.xml' ... done (3ms).\\n"
    reasons = [
        "worker was killed by SIGKILL",
        f'worker wrote b"{babble}" where an event was wanted',
        "worker exited with status 1: Traceback: the policy is NaN",
    ]
    reasons = [f"{reason}; 3 workers in a row finished no episode" for reason in reasons]
    assert [(run["state"], run["reason"], run["attempts"]) for run in failed] == [
        ("failed", each, 3) for each in reasons
    ]
    assert [run["episodes_done"] for run in failed] == [2, 2, 2]
    assert (sibling["state"], sibling["episodes_done"], sibling["attempts"]) == ("succeeded", 8, 1)
    assert broken["state"] == "failed"
    assert broken["reason"] in [f"run {run['id']}: {reason}" for run, reason in zip(failed, reasons, strict=True)]
    assert shared.wait(shared.post(budget={"episodes": 1}))["state"] == "succeeded"


@SQLITE_FIRST_SHARED
def test_what_the_workers_of_a_run_printed_can_be_read_and_need_not_be_sent_twice(shared, broken):
    campaign = broken | {"runs": broken["runs"][2:]}
    path, silent = (f"/v1/campaigns/{campaign['id']}/runs/{run['id']}/log" for run in campaign["runs"])
    log = shared.client.get(path)
    assert (log.status_code, log.headers["content-type"]) == (200, "text/plain; charset=utf-8")
    said = "Traceback: the policy is NaN\n"
    assert log.text.count(said) == 3, "of each worker"
    assert str(shared.data_dir) not in log.text
    assert shared.client.get(path, headers={"if-none-match": log.headers["etag"]}).status_code == 304
    assert shared.client.get(path, params={"lines": 1}).text == said
    for lines in ("0", "1001", "-1", "x"):
        assert shared.client.get(path, params={"lines": lines}).json()["errors"][0]["field"] == "lines"
    assert shared.client.get(silent).text == ""
    unknown = shared.client.get(f"/v1/campaigns/{campaign['id']}/runs/..%2F{campaign['runs'][0]['id']}/log")
    assert unknown.status_code == 404


@EACH_DATABASE_SHARED
def test_a_lost_worker_is_replaced_and_no_episode_is_lost_or_told_twice(shared, scripted):
    campaign_id = shared.post(seeds=[scripted.WAITS], budget={"episodes": 44})
    folder = shared.data_dir / "campaigns" / campaign_id / f"low-random-{scripted.WAITS}"
    for count in scripted.WAITS_AT:  # it waits there: a server that is slow to write would find a worker that is done
        shared.wait_for(campaign_id, lambda seen, count=count: seen["progress"]["episodes_done"] == count)
        (worker,) = shared.workers(campaign_id)
        os.kill(worker, signal.SIGKILL)
        (folder / f"go-{count}").touch()
    campaign = shared.wait(campaign_id)
    (run,) = campaign["runs"]
    assert (run["state"], run["attempts"], run["episodes_done"]) == ("succeeded", 3, 44)
    assert sorted(shared.episodes(campaign_id, run["id"])) == list(range(44))


@SQLITE_FIRST_SHARED
def test_cancel_stops_at_an_episode_and_keeps_what_was_found(shared):
    campaign_id = shared.post(seeds=[0, 1, 2], budget={"episodes": 1000})
    shared.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] > 4)
    for _ in range(2):
        cancelled = shared.client.post(f"/v1/campaigns/{campaign_id}/cancel")
        assert (cancelled.status_code, cancelled.headers["location"]) == (202, f"/v1/campaigns/{campaign_id}")
    campaign = shared.wait(campaign_id)
    assert campaign["state"] == "cancelled"
    assert [run["state"] for run in campaign["runs"]] == ["cancelled"] * 3
    assert campaign["progress"]["episodes_done"] == len(shared.get(campaign_id, "/episodes", limit=500)["items"]) > 4
    assert shared.workers(campaign_id) == []
    assert shared.client.post(f"/v1/campaigns/{campaign_id}/cancel").json() == campaign


@SQLITE_FIRST
def test_a_worker_that_ignores_the_cancel_is_killed_after_its_grace(serve, scripted):
    service = serve(grace_s=0.5, lease_s=60)
    campaign_id = service.post(seeds=[scripted.HANGS], budget={"episodes": 1000})
    service.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] > 0)
    started = time.monotonic()
    assert service.client.post(f"/v1/campaigns/{campaign_id}/cancel").json()["state"] == "cancelling"
    assert service.wait(campaign_id)["state"] == "cancelled"
    # By its grace: its lease would have ended it after 60 s, and its last episode after 50 s.
    assert 0.4 < time.monotonic() - started < 30
    assert service.workers() == []


@pytest.mark.parametrize(
    ("serve", "number"),
    [
        ("sqlite", signal.SIGKILL),
        ("postgresql", signal.SIGTERM),
        pytest.param("sqlite", signal.SIGTERM, marks=pytest.mark.torture),
        pytest.param("postgresql", signal.SIGKILL, marks=pytest.mark.torture),
    ],
    indirect=["serve"],
)
def test_a_restarted_server_goes_on_without_losing_or_repeating_an_episode(serve, number):
    service = serve()
    campaign_id = service.post(seeds=[0, 1, 2], budget={"episodes": 20})
    service.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] >= 10)
    service.stop(number)
    service.wait_until(lambda: service.workers() == [], alive=False)
    service.start()
    assert service.get(campaign_id)["progress"]["episodes_done"] >= 10
    campaign = service.wait(campaign_id)
    assert campaign["state"] == "succeeded"
    assert campaign["progress"]["episodes_done"] == 60
    for run in campaign["runs"]:
        assert sorted(service.episodes(campaign_id, run["id"])) == list(range(20))


@SQLITE_FIRST_SHARED
def test_two_servers_never_share_a_data_folder(shared):
    second = subprocess.run(
        [sys.executable, "-m", "service"],
        env=os.environ | {"RISK_SAC_DATA_DIR": str(shared.data_dir), "RISK_SAC_PORT": "8999"},
        capture_output=True,
        text=True,
        timeout=LONG_S,
        check=False,
    )
    assert second.returncode != 0
    assert "is in use by another process" in second.stderr


@SQLITE_FIRST_SHARED
def test_a_campaign_that_has_ended_can_be_deleted_with_its_files(shared):
    service = shared
    kept, gone = service.post(budget={"episodes": 2}), service.post(budget={"episodes": 300})
    service.wait(kept)
    service.wait_for(gone, lambda seen: seen["state"] == "running")
    assert service.client.delete(f"/v1/campaigns/{gone}").status_code == 409
    service.client.post(f"/v1/campaigns/{gone}/cancel")
    service.wait(gone)
    folder = service.data_dir / "campaigns"
    assert {path.name for path in folder.iterdir()} >= {kept, gone}
    service.wait_until(lambda: service.client.delete(f"/v1/campaigns/{gone}").status_code == 204)
    assert service.client.get(f"/v1/campaigns/{gone}").status_code == 404
    names = {path.name for path in folder.iterdir()}
    assert kept in names
    assert gone not in names
    assert service.get(kept, "/episodes")["items"]


@SQLITE_FIRST
def test_campaigns_go_when_they_have_been_kept_long_enough(serve):
    service = serve(retention_days=1e-6)
    campaign_id = service.post(budget={"episodes": 2})
    service.wait_until(lambda: service.client.get(f"/v1/campaigns/{campaign_id}").status_code == 404, timeout_s=90)
    assert not (service.data_dir / "campaigns" / campaign_id).exists()


@SQLITE_FIRST
def test_a_project_without_worker_hours_left_waits(serve):
    service = serve(quota_cpu_hours=1e-5, max_workers=1)
    campaign_id = service.post(seeds=[0, 1], budget={"episodes": 10})
    campaign = service.wait_for(campaign_id, lambda seen: seen["runs"][0]["state"] == "succeeded")
    time.sleep(1.5)
    campaign = service.get(campaign_id)
    assert [run["state"] for run in campaign["runs"]] == ["succeeded", "queued"]
    refused = service.client.post("/v1/campaigns", json={"families": ["low"]})
    assert refused.status_code == 429
    assert int(refused.headers["retry-after"]) > 0


def test_an_episode_that_crashes_its_worker_again_and_again_is_rejected_and_the_run_goes_on(serve):
    service = serve("crashing_worker", lease_s=30)
    campaign = service.wait(service.post(methods=["random"], budget={"episodes": 5}))
    (run,) = campaign["runs"]
    assert (run["state"], run["attempts"], run["episodes_done"], run["rejected"]) == ("succeeded", 3, 5, 1)
    episodes = service.get(campaign["id"], "/episodes")["items"]
    assert [(item["index"], item["reason"]) for item in episodes if item["outcome"] == "rejected"] == [(2, "sim_crash")]
    metrics = service.client.get("/metrics").text
    assert 'risk_sac_worker_restarts_total{cause="crashed"} 2.0' in metrics
