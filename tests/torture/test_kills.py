"""Randomly killed servers and workers lose nothing and change nothing.

The runs are real, of each kind of campaign in turn; one that was never disturbed says what they must come to.
"""

import os
import signal
import time
from collections.abc import Callable
from typing import Any

import pytest

from tests.integration.test_boundary_over_rest import OVER
from tests.integration.test_scenarios import DOCUMENT, archive_of
from tests.openscenario_samples import FILES
from tests.server import Service, servers

Outcome = tuple[dict[str, str], list[str]]
LONG_S = 900
pytestmark = pytest.mark.torture  # the suite kills a server and workers at chosen moments


@pytest.fixture(scope="module")
def specs(times: Callable[[int, int], int]) -> dict[str, dict[str, Any]]:
    """A campaign of each kind."""
    few, many = {"episodes": times(12, 60)}, {"episodes": times(20, 120)}
    learner = {"checkpoint_every": 3, "agent": {"warmup_steps": 200}, "warm_start": {"episodes": 2}}
    return {
        "learner": {
            "methods": ["risk-sac", "random"],
            "seeds": list(range(times(1, 2))),
            "budget": {"episodes": times(20, 60), "evaluation_episodes": 3},
            "learner": learner,
        },
        "own scenario in rounds": {"methods": ["archive"], "budget": many | {"batch": 4}},
        "imported story": {"methods": ["story-random"], "budget": few},
        "boundary": {
            "families": ["motorway_cut_in"],
            "methods": ["boundary"],
            "budget": few,
            "boundary": {"over": list(OVER)},
        },
        "rate": {"methods": ["rate"], "budget": many},
    }


def posted(service: Service, kind: str, spec: dict[str, Any]) -> str:
    """Posts a campaign, and before it the scenario that it is of."""
    if kind == "own scenario in rounds":
        spec = spec | {"families": [service.client.post("/v1/scenarios", json=DOCUMENT).json()["name"]]}
    if kind == "imported story":
        headers = {"content-type": "application/zip"}
        scenario = service.client.post("/v1/scenarios", content=archive_of(FILES), headers=headers)
        spec = spec | {"families": [scenario.json()["name"]]}
    return service.post(**spec)


@pytest.fixture(scope="module")
def undisturbed(specs: dict[str, dict[str, Any]], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Outcome]:
    """What the campaigns come to if nothing happens."""
    with servers(tmp_path_factory.mktemp("undisturbed")) as serve:
        service = serve("risk_sac.execution.worker", lease_s=60)
        return {kind: outcome(service, posted(service, kind, spec)) for kind, spec in specs.items()}


class Campaigns:
    """Campaigns of one service, each kind in turn, and their ids."""

    def __init__(self, service: Service, specs: dict[str, dict[str, Any]]) -> None:
        self.service, self.specs, self.ids = service, specs, []
        self.start_next()

    def start_next(self) -> None:
        """Starts a campaign of the next kind."""
        kind = self.kinds[len(self.ids)]
        self.ids.append(posted(self.service, kind, self.specs[kind]))

    @property
    def kinds(self) -> list[str]:
        """Kinds of the campaigns so far, and of the next one."""
        return [list(self.specs)[number % len(self.specs)] for number in range(len(self.ids) + 1)]

    def check(self, undisturbed: dict[str, Outcome]) -> None:
        """Fails where a campaign ended in another way than its undisturbed twin."""
        for campaign_id, kind in zip(self.ids, self.kinds, strict=False):
            assert outcome(self.service, campaign_id) == undisturbed[kind], kind


def outcome(service: Service, campaign_id: str) -> Outcome:
    """Digest of each run, and every episode."""
    campaign = service.wait(campaign_id, LONG_S)
    assert campaign["state"] == "succeeded", campaign["reason"]
    digests = {run["id"]: run["digest"] for run in service.get(campaign_id, "/results")["runs"]}
    return digests, sorted(service.episode_ids(campaign_id))


@pytest.mark.timeout(3600)
def test_a_server_killed_at_random_moments_loses_and_repeats_no_episode(serve, specs, undisturbed, times, chance, tell):
    service = serve("risk_sac.execution.worker", lease_s=60)
    kills = times(5, 80)
    done, campaigns = 0, Campaigns(service, specs)
    while done < kills:
        time.sleep(chance.uniform(0, 9))
        if service.get(campaigns.ids[-1])["state"] == "succeeded":  # faster than the kills
            campaigns.start_next()
            continue
        known = service.episode_ids(campaigns.ids[-1])
        service.stop(signal.SIGKILL)
        done += 1
        service.wait_until(lambda: service.workers() == [], timeout_s=10, alive=False)
        service.start()
        assert service.episode_ids(campaigns.ids[-1])[: len(known)] == known, "finished episodes were lost"
    campaigns.check(undisturbed)
    tell(f"server: {done} kills in {len(campaigns.ids)} campaigns; all digests and episodes as if undisturbed")


@pytest.mark.timeout(3600)
def test_workers_killed_crashed_and_stopped_at_random_moments_change_nothing(
    serve, specs, undisturbed, times, chance, tell
):
    service = serve("risk_sac.execution.worker", attempts=100)
    server = service.process.pid
    done, slowest_s, campaigns = dict.fromkeys(("SIGKILL", "SIGSEGV", "SIGSTOP"), 0), 0.0, Campaigns(service, specs)
    while sum(done.values()) < times(6, 120):
        time.sleep(chance.uniform(0, 6))
        if service.get(campaigns.ids[-1])["state"] == "succeeded":
            campaigns.start_next()
        workers = service.workers()
        if not workers:
            continue
        victim, fault = chance.choice(workers), min(done, key=done.__getitem__)
        os.kill(victim, getattr(signal, fault))
        struck = time.monotonic()
        service.wait_until(lambda victim=victim: victim not in service.workers(), timeout_s=30)
        slowest_s = max(slowest_s, time.monotonic() - struck)
        done[fault] += 1
    campaigns.check(undisturbed)
    replaced = sum(run["attempts"] - 1 for each in campaigns.ids for run in service.get(each)["runs"])
    assert replaced <= sum(done.values()), "a sibling went along"
    assert (service.process.pid, service.process.poll()) == (server, None)
    assert slowest_s <= 5
    tell(f"workers: {done} in {len(campaigns.ids)} campaigns, gone within {slowest_s:.1f} s, {replaced} replaced; "
         "all digests as if undisturbed, no sibling hurt")  # fmt: skip


@pytest.mark.timeout(900)
def test_a_server_told_to_stop_leaves_within_20_s_and_goes_on_afterwards(
    serve, specs, undisturbed, times, chance, tell
):
    service = serve("risk_sac.execution.worker")
    campaign_id, slowest_s = posted(service, "learner", specs["learner"]), 0.0
    stops = times(2, 10)
    for _ in range(stops):
        time.sleep(chance.uniform(0, 6))
        told = time.monotonic()
        service.stop(signal.SIGTERM)
        slowest_s = max(slowest_s, time.monotonic() - told)
        assert service.workers() == []
        service.start()
    assert outcome(service, campaign_id) == undisturbed["learner"]
    assert slowest_s <= 20
    tell(f"SIGTERM: {stops} stops, the slowest took {slowest_s:.1f} s; all digests as if undisturbed")
