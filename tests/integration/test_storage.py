"""A disk that fills up or refuses."""

import re
import resource
import signal
import sqlite3
from contextlib import closing

import pytest

from tests.postgresql import binaries, running
from tests.server import LONG_S, servers

FIRST = ["sqlite", pytest.param("postgresql", marks=pytest.mark.torture)]
SQLITE_FIRST = pytest.mark.parametrize("serve", FIRST, indirect=True)
SQLITE_FIRST_SHARED = pytest.mark.parametrize("serve_shared", FIRST, indirect=True)


@pytest.fixture(scope="module")
def shared(serve_shared):
    return serve_shared()


def test_a_database_that_cannot_grow_pauses_the_campaign_until_it_can(serve):
    service = serve()
    earlier = service.post(label="earlier", budget={"episodes": 5})
    service.wait(earlier)
    campaign_id = service.post(seeds=[0, 1], budget={"episodes": 40})
    service.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] > 3)
    # To a process that may not let any file grow, every write looks like one to a full disk.
    unlimited = resource.prlimit(service.process.pid, resource.RLIMIT_FSIZE, (1, resource.RLIM_INFINITY))
    campaign = service.wait_for(campaign_id, lambda seen: seen["state"] == "paused")
    assert campaign["reason"].startswith("storage failed while storing episodes: ")
    assert {run["state"] for run in campaign["runs"]} == {"paused"}
    service.wait_until(lambda: service.workers() == [])
    assert len(service.get(campaign_id, "/episodes")["items"]) > 3
    assert service.get(earlier, "/results")["complete"]
    refused = service.client.post("/v1/campaigns", json={"families": ["low"]})
    assert refused.status_code == 503
    assert refused.json()["detail"].startswith("storage failed while creating a campaign: ")
    assert service.client.get("/healthz").status_code == 200
    ready = service.client.get("/readyz")
    assert (ready.status_code, ready.json()["reason"]) == (503, "storage_unavailable")
    assert ready.json()["detail"].startswith("storage failed while ")
    assert "\nrisk_sac_storage_available 0.0\n" in service.client.get("/metrics").text

    resource.prlimit(service.process.pid, resource.RLIMIT_FSIZE, unlimited)
    campaign = service.wait(campaign_id)
    assert (campaign["state"], campaign["progress"]["episodes_done"]) == ("succeeded", 80)
    for run in campaign["runs"]:
        assert sorted(service.episodes(campaign_id, run["id"])) == list(range(40))
    assert service.client.get("/readyz").status_code == 200


def test_a_lock_of_the_database_is_told_as_such_and_when_to_ask_again(serve):
    service = serve()
    campaign_id = service.post(budget={"episodes": 100_000})
    service.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] > 3)
    with closing(sqlite3.connect(service.data_dir / "risk-sac.db", isolation_level=None, timeout=LONG_S)) as other:
        other.execute("BEGIN IMMEDIATE")
        service.wait_for(campaign_id, lambda seen: seen["state"] == "paused")
        for refused in (
            service.client.post("/v1/campaigns", json={"families": ["low"]}),
            service.client.get("/readyz"),
        ):
            assert (refused.status_code, refused.json()["reason"]) == (503, "storage_unavailable")
            assert int(refused.headers["retry-after"]) > 0
        other.execute("ROLLBACK")
    service.wait_for(campaign_id, lambda seen: seen["state"] == "running")
    (line,) = (line for line in service.log.read_text().splitlines() if "works again" in line)
    assert re.search(r"^\d{4}-\d\d-\d\dT[\d:.]{12}\+00:00 INFO .*refused \(.*locked.*\); 1 runs? go", line)


@SQLITE_FIRST_SHARED
def test_a_disk_that_is_full_for_a_worker_pauses_its_campaign_until_there_is_room(shared, scripted):
    campaign_id = shared.post(seeds=[scripted.DISK_FULL, scripted.WELL_BEHAVED], budget={"episodes": 10})
    campaign = shared.wait_for(campaign_id, lambda seen: seen["state"] == "paused")
    assert campaign["reason"].endswith("storage failed: No space left on device")
    assert shared.get(campaign["id"], "/episodes")["items"]
    (shared.data_dir / "campaigns" / campaign_id / "room").touch()
    campaign = shared.wait(campaign_id)
    assert (campaign["state"], campaign["progress"]["episodes_done"]) == ("succeeded", 20)


def test_a_paused_campaign_can_be_cancelled(shared, scripted):
    campaign_id = shared.post(seeds=[scripted.DISK_FULL], budget={"episodes": 40})
    shared.wait_for(campaign_id, lambda seen: seen["state"] == "paused")
    shared.client.post(f"/v1/campaigns/{campaign_id}/cancel")
    campaign = shared.wait(campaign_id)
    assert (campaign["state"], campaign["progress"]["episodes_done"]) == ("cancelled", 2)


@SQLITE_FIRST
def test_a_pause_outlives_the_server(serve, scripted):
    service = serve()
    campaign_id = service.post(seeds=[scripted.DISK_FULL], budget={"episodes": 10})
    service.wait_for(campaign_id, lambda seen: seen["state"] == "paused")
    service.stop(signal.SIGKILL)
    (service.data_dir / "campaigns" / campaign_id / "room").touch()
    service.start()
    assert service.wait(campaign_id)["state"] == "succeeded"


def test_a_data_folder_that_refuses_pauses_the_campaign_and_not_the_server(serve):
    service = serve()
    earlier = service.post(budget={"episodes": 3})
    service.wait(earlier)
    folder = service.data_dir / "campaigns"
    folder.rename(service.data_dir / "kept")
    folder.write_text("in the way")
    campaign_id = service.post(budget={"episodes": 2})
    campaign = service.wait_for(campaign_id, lambda seen: seen["state"] == "paused")
    assert "storage failed while starting a run: " in campaign["reason"]
    assert service.get(earlier, "/episodes")["items"]
    folder.unlink()
    assert service.wait(campaign_id)["state"] == "succeeded"


def test_a_database_server_that_goes_away_pauses_what_runs_until_it_is_back(tmp_path):
    bin_ = binaries()
    if bin_ is None:
        pytest.skip("PostgreSQL is not installed")
    with running(bin_) as server, servers(tmp_path, database_url=server.new_database()) as serve:
        service = serve()
        campaign_id = service.post(budget={"episodes": 60})
        service.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] > 3)
        server.stop()
        service.wait_until(lambda: service.client.get("/readyz").status_code == 503)
        assert service.client.get(f"/v1/campaigns/{campaign_id}/episodes").status_code == 503  # no kept answer
        assert service.client.get("/healthz").status_code == 200
        server.start()
        campaign = service.wait(campaign_id)
        assert (campaign["state"], campaign["progress"]["episodes_done"]) == ("succeeded", 60)


def test_two_servers_never_share_a_postgresql_database(serve, postgresql, tmp_path):
    url = postgresql.new_database()
    serve(database_url=url)
    second = serve(database_url=url, data_dir=tmp_path / "other", started=False)
    assert not second.launch()
    assert "is in use by another server" in second.log.read_text()
