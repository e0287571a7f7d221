"""An ego over its versions, on a real server."""

import pytest

BUDGET = {"episodes": 12}
EGO = "careful"  # which no other test posts to this server


@pytest.fixture(scope="module")
def service(striking):
    return striking


def posted(service, label, **spec):
    """Runs a campaign of this version of the ego; returns its id."""
    campaign_id = service.post(**{"ego": {"profile": EGO, "label": label}, "budget": BUDGET} | spec)
    assert service.wait(campaign_id)["state"] == "succeeded"
    return campaign_id


@pytest.fixture(scope="module")
def campaigns(service):
    """Ids of campaigns: two versions alike, a larger budget, another scenario."""
    iid = {"episodes": 10}
    return {
        "1.3": posted(service, "1.3", iid=iid),
        "1.4": posted(service, "1.4", iid=iid),
        "longer": posted(service, "1.4", iid=iid, budget={"episodes": 14}),
        "dense": posted(service, "1.4", iid=iid, families=["dense"]),
    }


def trend(service, ego=EGO, **query):
    return service.client.get(f"/v1/egos/{ego}/trend", params=query)


def test_versions_on_the_same_terms_are_in_one_row(service, campaigns):
    answer = trend(service)
    assert answer.status_code == 200, answer.text
    first, *others = answer.json()["rows"]
    assert [(point["version"], point["campaign_id"]) for point in first["points"]] == [
        ("1.3", campaigns["1.3"]),
        ("1.4", campaigns["1.4"]),
    ]
    for point in first["points"]:
        rates = {(rate["method"], rate["requirement"]): rate["count"] for rate in point["rates"]}
        assert rates["iid-random", None] == rates["iid-undisturbed", None] == 5
        assert point["requirements"]["no_contact"]["valid"] == 6
    assert {tuple(row["differs"]) for row in others} == {("budget.episodes",), ("families",)}
    again = service.client.get(f"/v1/egos/{EGO}/trend", headers={"if-none-match": answer.headers["etag"]})
    assert again.status_code == 304


def test_a_campaign_that_goes_on_is_left_out(service, campaigns):
    waiting = service.post(ego={"profile": EGO, "label": "1.5"}, budget={"episodes": 200})
    left_out = trend(service).json()["left_out"]
    assert [left["campaign_id"] for left in left_out] == [waiting]
    service.client.post(f"/v1/campaigns/{waiting}/cancel")
    service.wait(waiting)


def test_chosen_campaigns_are_compared_alone(service, campaigns):
    (row,) = trend(service, campaign=[campaigns["1.4"]]).json()["rows"]
    assert [point["version"] for point in row["points"]] == ["1.4"]


def test_a_trend_over_other_scenarios_is_refused(service, campaigns):
    answer = trend(service, campaign=[campaigns["1.3"], campaigns["dense"]])
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["field"] == "campaign"
    assert trend(service, campaign=[campaigns["1.3"], campaigns["longer"]]).status_code == 200


def test_a_campaign_of_another_ego_is_refused(service, campaigns):
    answer = trend(service, ego="r157", campaign=[campaigns["1.3"]])
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "campaign")


def test_a_campaign_that_there_is_not_is_not_found(service):
    assert trend(service, campaign=["c0"]).status_code == 404


def test_an_ego_without_campaigns_has_no_rows(service):
    assert trend(service, ego="never-tested").json() == {"rows": [], "left_out": []}
