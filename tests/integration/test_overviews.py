"""Overviews of a whole campaign and people's notes, on a real server."""

from types import SimpleNamespace

import pytest

from risk_sac.client import Client

EPISODES = 24


@pytest.fixture(scope="module")
def service(striking):
    return striking


@pytest.fixture(scope="module")
def campaign(service):
    campaign_id = service.post(seeds=[0, 1], budget={"episodes": EPISODES})
    assert service.wait(campaign_id)["state"] == "succeeded"
    return campaign_id


def test_power_tells_what_the_campaigns_methods_were_measured_with(service, campaign):
    with Client(str(service.client.base_url)) as client:
        power = client.power(campaign)
    assert {each.method for each in power.methods} == {run["method"] for run in service.get(campaign)["runs"]}
    assert all(each.sentences for each in power.methods)
    assert service.get(campaign, "/power") == power.model_dump(mode="json")


@pytest.fixture
def noted(service, campaign):
    """A failure, and how to note something of it."""
    failure = service.get(campaign, "/failures")["items"][3]["id"]
    path = f"/v1/campaigns/{campaign}/failures/{failure}"

    def put(**body):
        return service.client.put(f"{path}/triage", json=body)

    return SimpleNamespace(id=failure, path=path, put=put)


def test_a_triage_shows_wherever_its_failure_does(service, campaign, noted):
    table = f"/v1/campaigns/{campaign}/failure-table"
    before = service.client.get(table)
    assert service.client.get(noted.path).json()["triage"] is None
    answer = noted.put(state="confirmed", comment="brakes late <script>alert(1)</script>\n\tünd so weiter")
    assert answer.status_code == 200, answer.text
    assert answer.json()["comment"] == "brakes late <script>alert(1)</script>\n\tünd so weiter"
    assert service.client.get(noted.path).json()["triage"] == answer.json()
    after = service.client.get(table, headers={"if-none-match": before.headers["etag"]})
    assert after.status_code == 200
    states = dict(zip(after.json()["ids"], after.json()["triage"], strict=True))
    assert states.pop(noted.id) == "confirmed"
    assert set(states.values()) == {"new"}
    again = noted.put(state="confirmed", comment=answer.json()["comment"])
    assert again.json() == answer.json(), "the same again changes nothing"
    assert service.client.get(table).headers["etag"] == after.headers["etag"]
    assert noted.put(state="fixed").json() | {"changed_at": ""} == {"state": "fixed", "comment": "", "changed_at": ""}
    assert "fixed" in service.client.get(table).json()["triage"]
