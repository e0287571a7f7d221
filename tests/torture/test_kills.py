"""Servers and workers that are killed at random moments lose nothing and change nothing.

The runs are real; a campaign that was never disturbed says what they must come to.
"""

import os
import signal
import time
from collections.abc import Callable
from typing import Any

import pytest

from tests.server import Service, servers

Outcome = tuple[dict[str, str], list[str]]
LONG_S = 900
pytestmark = pytest.mark.torture  # the suite kills a server and workers at chosen moments


@pytest.fixture(scope="module")
def spec(times: Callable[[int, int], int]) -> dict[str, Any]:
    return {
        "families": ["low"],
        "methods": ["risk-sac", "random"],
        "seeds": list(range(times(1, 2))),
        "budget": {"episodes": times(20, 60), "evaluation_episodes": 3},
        "learner": {"checkpoint_every": 3, "agent": {"warmup_steps": 200}, "warm_start": {"episodes": 2}},
    }


@pytest.fixture(scope="module")
def undisturbed(spec: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """What the campaign comes to if nothing happens."""
    with servers(tmp_path_factory.mktemp("undisturbed")) as serve:
        service = serve("risk_sac.execution.worker", lease_s=60)
        return outcome(service, service.post(**spec))


def outcome(service: Service, campaign_id: str) -> Outcome:
    """Digest of each run, and every episode."""
    campaign = service.wait(campaign_id, LONG_S)
    assert campaign["state"] == "succeeded", campaign["reason"]
    digests = {run["id"]: run["digest"] for run in service.get(campaign_id, "/results")["runs"]}
    return digests, sorted(service.episode_ids(campaign_id))


@pytest.mark.timeout(3600)
def test_a_server_killed_at_random_moments_loses_and_repeats_no_episode(serve, spec, undisturbed, times, chance, tell):
    service = serve("risk_sac.execution.worker", lease_s=60)
    kills = times(3, 50)
    done, campaigns = 0, [service.post(**spec)]
    while done < kills:
        time.sleep(chance.uniform(0, 9))
        if service.get(campaigns[-1])["state"] == "succeeded":  # faster than the kills
            campaigns.append(service.post(**spec))
            continue
        known = service.episode_ids(campaigns[-1])
        service.stop(signal.SIGKILL)
        done += 1
        service.wait_until(lambda: service.workers() == [], timeout_s=10, alive=False)
        service.start()
        assert service.episode_ids(campaigns[-1])[: len(known)] == known, "finished episodes were lost"
    for campaign_id in campaigns:
        assert outcome(service, campaign_id) == undisturbed
    tell(f"server: {done} kills in {len(campaigns)} campaigns; all digests and episodes as if undisturbed")


@pytest.mark.timeout(3600)
def test_workers_killed_crashed_and_stopped_at_random_moments_change_nothing(
    serve, spec, undisturbed, times, chance, tell
):
    service = serve("risk_sac.execution.worker", attempts=100)
    server = service.process.pid
    done, slowest_s, campaigns = dict.fromkeys(("SIGKILL", "SIGSEGV", "SIGSTOP"), 0), 0.0, [service.post(**spec)]
    while sum(done.values()) < times(6, 100):
        time.sleep(chance.uniform(0, 6))
        if service.get(campaigns[-1])["state"] == "succeeded":
            campaigns.append(service.post(**spec))
        workers = service.workers()
        if not workers:
            continue
        victim, fault = chance.choice(workers), min(done, key=done.__getitem__)
        os.kill(victim, getattr(signal, fault))
        struck = time.monotonic()
        service.wait_until(lambda victim=victim: victim not in service.workers(), timeout_s=30)
        slowest_s = max(slowest_s, time.monotonic() - struck)
        done[fault] += 1
    for campaign_id in campaigns:
        assert outcome(service, campaign_id) == undisturbed
    replaced = sum(run["attempts"] - 1 for each in campaigns for run in service.get(each)["runs"])
    assert replaced <= sum(done.values()), "a sibling went along"
    assert (service.process.pid, service.process.poll()) == (server, None)
    assert slowest_s <= 5
    tell(f"workers: {done} in {len(campaigns)} campaigns, gone within {slowest_s:.1f} s, {replaced} replaced; "
         "all digests as if undisturbed, no sibling hurt")  # fmt: skip


@pytest.mark.timeout(900)
def test_a_server_told_to_stop_leaves_within_20_s_and_goes_on_afterwards(serve, spec, undisturbed, times, chance, tell):
    service = serve("risk_sac.execution.worker")
    campaign_id, slowest_s = service.post(**spec), 0.0
    stops = times(2, 10)
    for _ in range(stops):
        time.sleep(chance.uniform(0, 6))
        told = time.monotonic()
        service.stop(signal.SIGTERM)
        slowest_s = max(slowest_s, time.monotonic() - told)
        assert service.workers() == []
        service.start()
    assert outcome(service, campaign_id) == undisturbed
    assert slowest_s <= 20
    tell(f"SIGTERM: {stops} stops, the slowest took {slowest_s:.1f} s; all digests as if undisturbed")
