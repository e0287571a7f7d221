"""A disk that refuses a service's first writes loses nothing."""

import sqlite3
import time
from random import Random

import httpx
import pytest

from tests.server import servers
from tests.torture.disk import Disk, compiler

pytestmark = pytest.mark.torture  # the suite fills the disk of scripted and of real workers
SPEC = {"families": ["low"], "methods": ["bo-only"], "budget": {"episodes": 4}, "learner": {"checkpoint_every": 1}}


@pytest.fixture(scope="module")
def wanted(tmp_path_factory):
    """What the campaign comes to on a sound disk."""
    with servers(tmp_path_factory.mktemp("sound")) as serve:
        service = serve("risk_sac.execution.worker")
        return outcome(service, service.post(**SPEC))


@pytest.mark.timeout(7200)
@pytest.mark.skipif(compiler() is None, reason="needs a C compiler for the disk that refuses")
@pytest.mark.parametrize("since", ["start", "campaign"])
def test_no_write_that_the_disk_refuses_loses_or_breaks_anything(serve, wanted, since, times, tmp_path, tell):
    numbers = sorted(Random(0).sample(range(1, 101), times(3, 100)))
    met = paused = unstarted = 0
    for number in numbers:
        root = tmp_path / f"data{number}"
        disk = Disk(tmp_path, root)
        service = serve(
            "risk_sac.execution.worker", data_dir=root, environment=disk.environment, started=since == "campaign"
        )
        (disk.fill if number % 2 else disk.fail_once)(number)
        if since == "start" and not service.launch():
            unstarted += 1
            assert "Traceback" not in service.log.read_text(), "it should say why in a line"
            disk.heal()
            service.start()
        campaign_id, seen = follow(service, disk)
        met += disk.refused > 0
        paused += seen
        assert outcome(service, campaign_id) == wanted, f"write {number}"
        service.stop()
        with sqlite3.connect(root / "risk-sac.db") as database:
            assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        database.close()
        disk.close()
    assert met > 0
    tell(f"disk, writes since the {since}: {len(numbers)} chosen, {met} refused, {unstarted} of them a start, "
         f"{paused} paused a campaign; every campaign came to the result of a sound disk")  # fmt: skip


def follow(service, disk):
    """Posts carefully, heals the disk once noticed; returns whether a pause showed."""
    paused = queued = False
    headers = {"Idempotency-Key": "the-one"}
    campaign_id = None
    while True:
        time.sleep(0.05)
        try:
            if campaign_id is None:
                answer = service.client.post("/v1/campaigns", json=SPEC, headers=headers)
                assert answer.status_code in (202, 503), answer.text
                campaign_id = answer.json().get("id")
            else:
                campaign = service.get(campaign_id)
                paused |= campaign["state"] == "paused"
                queued = campaign["state"] == "queued"
                if campaign["state"] not in ("queued", "running", "paused"):
                    return campaign_id, paused
        except httpx.TransportError as error:
            raise AssertionError(service.log.read_text()[-2000:]) from error
        if disk.refused and (paused or campaign_id is None or (queued and not ready(service))):
            disk.heal()


def ready(service):
    return service.client.get("/readyz").status_code == 200


def outcome(service, campaign_id):
    campaign = service.wait(campaign_id)
    assert campaign["state"] == "succeeded", campaign["reason"]
    (run,) = service.get(campaign_id, "/results")["runs"]
    failures = service.get(campaign_id, "/failures", tier="raw")["items"]
    series = [service.get(campaign_id, f"/failures/{each['id']}")["series"] for each in failures]
    return run["digest"], sorted(service.episode_ids(campaign_id)), series
