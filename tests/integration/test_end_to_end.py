"""The whole way with the real worker: REST, libsumo, RISK-SAC, results."""

import json
import signal

from risk_sac.run_folder.results import read_results

SPEC = {
    "families": ["low"],
    "methods": ["risk-sac"],
    "seeds": [1],
    "budget": {"episodes": 5, "evaluation_episodes": 1},
    "learner": {
        "checkpoint_every": 2,
        "agent": {"warmup_steps": 200, "hidden_sizes": [16], "batch_size": 16},
        "warm_start": {"episodes": 1},
    },
}


def run_folder(service, campaign_id, run_id):
    return service.data_dir / "campaigns" / campaign_id / run_id


def test_a_campaign_finds_the_same_with_and_without_a_crash_of_the_server(real):
    service = real
    calm = service.wait(service.post(**SPEC))
    assert calm["state"] == "succeeded", calm["reason"]
    results = service.get(calm["id"], "/results")
    (run,) = results["runs"]
    assert run["metrics"]["episodes"] == 5
    assert run["evaluation"]["episodes"] == 1
    assert {"libsumo", "torch", "risk-sac"} <= set(run["versions"])

    shaken = service.post(**SPEC)
    service.wait_for(shaken, lambda seen: seen["progress"]["episodes_done"] >= 3)
    service.stop(signal.SIGKILL)
    service.start()
    assert service.wait(shaken)["state"] == "succeeded", service.get(shaken)["reason"]
    assert service.episodes(shaken, run["id"]) == list(range(6))
    assert service.get(shaken, "/results")["runs"][0]["digest"] == run["digest"]

    at_once, resumed = (read_results(run_folder(service, id_, run["id"])) for id_ in (calm["id"], shaken))
    assert (resumed.finished, resumed.digest) == (True, run["digest"])
    assert (resumed.metrics, resumed.evaluation) == (at_once.metrics, at_once.evaluation)
    assert resumed.failures == at_once.failures
    lines = (run_folder(service, shaken, run["id"]) / "episodes.jsonl").read_text().splitlines()
    assert [json.loads(line)["index"] for line in lines] == list(range(6))
