"""What is made of a failure by playing it again, over REST: a real campaign of a real server."""

import pytest

from risk_sac import cli
from risk_sac.client import Client, Refused
from risk_sac.failures.bundle import read_bundle
from risk_sac.failures.minimise import HELD

SPEC = {"families": ["low"], "methods": ["archive"], "seeds": [3], "budget": {"episodes": 40}}


@pytest.fixture
def campaign(serve):
    """A server, the id of a campaign that has ended, and that of one of its failures."""
    service = serve("service.worker", grace_s=30, replays=2)
    campaign_id = service.post(**SPEC)
    ended = service.wait(campaign_id)
    assert ended["state"] == "succeeded", ended["reason"]
    failure = service.get(campaign_id, "/failures")["items"][0]
    return service, campaign_id, failure


def test_a_failure_comes_as_a_bundle_with_its_core_region_and_twins(campaign, tmp_path, monkeypatch):
    service, campaign_id, failure = campaign
    url, id_ = f"http://127.0.0.1:{service.port}", failure["id"]
    monkeypatch.setenv("RISK_SAC_URL", url)
    asked = ["campaigns", "failures", "bundle", campaign_id, id_, "--out"]
    assert cli.main([*asked, str(tmp_path / "failure.npz")]) == 0
    assert cli.main(["replay", str(tmp_path / "failure.npz")]) == 0
    assert cli.main([*asked, str(tmp_path / "core.npz"), "--core"]) == 0
    core = read_bundle(tmp_path / "core.npz").manifest.core
    assert core is not None
    assert core.after.segments <= core.before.segments
    assert core.held >= HELD or core.after == core.before  # of a needle, nothing is taken away

    region = service.get(campaign_id, f"/failures/{id_}/region")
    assert [share["played"] for share in region["shares"]] == [40, 40, 40, 10, 40]
    with Client(url) as client:
        assert client.picture(campaign_id, id_, "perfect").startswith(b"\x89PNG")
        with pytest.raises(Refused) as refused:
            client.picture(campaign_id, id_, "nobody")
        assert refused.value.status == 422

    replayed = [each for each in service.get(campaign_id, "/failures", limit=100)["items"] if each["repetition"]]
    assert all(each["repetition"] == {"times": 2, "same": 2} for each in replayed)
    (run,) = service.get(campaign_id, "/results")["runs"]
    assert run["metrics"]["distinct_failures"] <= len(replayed) == run["verified"]
    assert run["flaky"] == 0

    clusters = service.get(campaign_id, "/clusters")
    assert clusters["complete"]
    found = clusters["families"]["low"]["clusters"]
    metrics = service.get(campaign_id, "/results")["runs"][0]["metrics"]
    assert {cluster["name"]: cluster["failures"] for cluster in found} == metrics["signatures"]
    ids = {each["id"] for each in service.get(campaign_id, "/failures", limit=100)["items"]}
    assert {cluster["representative"] for cluster in found} <= ids
