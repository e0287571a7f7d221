"""The client against a real server."""

import json
import signal
import threading
import time
from collections.abc import Iterator

import pytest

from risk_sac.client import Campaign, Client
from risk_sac.config import Budget, CampaignSpec
from risk_sac.records import wire
from tests.server import LONG_S, Service

SPEC = CampaignSpec(label="a", families=("low",), methods=("random",), seeds=(0, 1), budget=Budget(episodes=6))


@pytest.fixture(scope="module")
def shared(striking: Service) -> Service:
    return striking


@pytest.fixture
def client(shared: Service) -> Iterator[Client]:
    with connected(shared) as client:
        yield client


def connected(service: Service) -> Client:
    return Client(f"http://127.0.0.1:{service.port}")


def test_a_campaign_is_submitted_followed_and_read(shared, client):
    seen: list[Campaign] = []
    campaign = client.wait(client.submit(SPEC).id, seen.append, timeout_s=LONG_S)
    assert campaign.state == "succeeded"
    assert [each.progress.episodes_done for each in seen] == sorted(each.progress.episodes_done for each in seen)
    assert campaign.progress.episodes_done == 12
    assert json.loads(wire(campaign)) == shared.get(campaign.id)
    results = client.results(campaign.id)
    assert json.loads(wire(results)) == shared.get(campaign.id, "/results")
    assert [(total.method, total.failures) for total in results.totals] == [("random", 6)]
    assert client.table(campaign.id).startswith("# Comparison of methods")


@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.torture)])
def test_a_server_that_is_lost_and_restarted_is_a_pause(number, serve):
    service = serve()

    def restart(campaign_id: str) -> None:
        service.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] >= 10)
        service.stop(number)
        time.sleep(1)
        service.start()

    with connected(service) as client:
        campaign = client.submit(SPEC.model_copy(update={"budget": Budget(episodes=40)}))
        heard: list[str] = []
        listening = threading.Thread(target=lambda: heard.extend(event.id for event in client.events(campaign.id)))
        restarting = threading.Thread(target=restart, args=[campaign.id])
        for thread in (listening, restarting):
            thread.start()
        seen: list[Campaign] = []
        assert client.wait(campaign.id, seen.append, timeout_s=LONG_S).progress.episodes_done == 80
        for thread in (listening, restarting):
            thread.join()
    assert seen[0].progress.episodes_done < 80 == seen[-1].progress.episodes_done
    assert len(set(heard)) == len(heard) >= 81
