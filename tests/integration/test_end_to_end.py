"""The whole way with the real worker: REST, libsumo, RISK-SAC, results."""

import json
import signal

from risk_sac import cli
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


def test_every_contact_can_be_read_with_its_full_time_series_and_drawn(real, tmp_path):
    service = real
    campaign_id = service.post(families=["mixed"], methods=["random"], budget={"episodes": 60})
    campaign = service.wait(campaign_id)
    assert campaign["state"] == "succeeded", campaign["reason"]
    contacts = service.get(campaign_id, "/failures", tier="raw")["items"]
    assert len(contacts) == campaign["progress"]["raw_collisions"] > 0
    assert len(service.get(campaign_id, "/failures")["items"]) == campaign["progress"]["failures"]
    for contact in contacts:
        failure = service.get(campaign_id, f"/failures/{contact['id']}")
        assert failure["series_problem"] is None
        series = failure["series"]
        steps, actors = len(series["time_s"]), len(series["ids"])
        assert series["role"][0] == "ego"
        assert contact["collision"]["other_id"] in series["ids"]
        for name in ("x_m", "y_m", "heading_rad", "speed_mps", "accel_mps2", "visible", "distance_m", "ttc_s"):
            assert [len(row) for row in series[name]] == [actors] * steps, name
        assert [len(row) for row in series["robustness"]] == [len(series["requirements"])] * steps

    folder = run_folder(service, campaign_id, campaign["runs"][0]["id"])
    assert [failure.episode.index for failure in read_results(folder).failures] == [each["index"] for each in contacts]
    picture = tmp_path / "contact.png"
    assert cli.main(["show", str(folder), str(contacts[0]["index"]), "--out", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    url = f"http://127.0.0.1:{service.port}"
    remote = ["campaigns", "failures", "show", campaign_id, contacts[0]["id"], "--url", url, "--out", str(picture)]
    assert cli.main(remote) == 0
    assert (
        picture.read_bytes()
        == service.client.get(f"{url}/v1/campaigns/{campaign_id}/failures/{contacts[0]['id']}/picture.png").content
    )
