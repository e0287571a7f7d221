"""What shows a whole campaign at once, on a real server."""

import pytest

EPISODES = 24


@pytest.fixture(scope="module")
def service(serve_shared):
    return serve_shared("striking_worker")


@pytest.fixture(scope="module")
def campaign(service):
    campaign_id = service.post(seeds=[0, 1], budget={"episodes": EPISODES})
    assert service.wait(campaign_id)["state"] == "succeeded"
    return campaign_id


def test_the_failure_table_has_what_the_list_of_failures_has(service, campaign):
    table = service.get(campaign, "/failure-table")
    listed = service.get(campaign, "/failures", limit=500)["items"]
    assert table["ids"] == [each["id"] for each in listed]
    assert len(table["ids"]) == EPISODES
    assert table["grade"] == [each["collision"]["judgement"]["grade"] for each in listed]
    assert table["relative_speed_mps"] == [each["collision"]["relative_speed_mps"] for each in listed]
    lists = {name: len(values) for name, values in table.items() if name not in ("kinds", "scenes")}
    assert lists == dict.fromkeys(lists, EPISODES)
    assert sum(table["distinct"]) == 2, "the first of each run: all are alike"
    assert [kind["failures"] for kind in table["kinds"]] == [EPISODES]


def test_the_failure_table_is_kept_while_nothing_changes(service, campaign):
    url = f"/v1/campaigns/{campaign}/failure-table"
    first = service.client.get(url)
    again = service.client.get(url, headers={"if-none-match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["etag"] == first.headers["etag"]


@pytest.mark.parametrize("query", [{"tier": "all"}, {"tier": ""}, {"tier": "raw\0"}])
def test_an_unknown_tier_is_refused(service, campaign, query):
    response = service.client.get(f"/v1/campaigns/{campaign}/failure-table", params=query)
    assert response.status_code == 422
    assert response.json()["errors"][0]["field"] == "tier"


def test_curves_follow_the_search_of_each_run(service, campaign):
    runs = service.get(campaign, "/curves")["runs"]
    assert [run["run_id"] for run in runs] == ["low-random-0", "low-random-1"]
    for run in runs:
        assert run["episodes"] == list(range(1, EPISODES + 1))
        assert run["preventable"][-1] == service.get(campaign)["runs"][run["seed"]]["preventable"]
    few = service.get(campaign, "/curves", points=5)["runs"][0]
    assert few["episodes"] == [5, 10, 15, 20, 24]
    assert few["window_ecr"] == [runs[0]["window_ecr"][count - 1] for count in few["episodes"]]


@pytest.mark.parametrize("points", [0, -1, 1001, "x", "", 1.5, "2\0"])
def test_so_many_points_as_nobody_draws_are_refused(service, campaign, points):
    response = service.client.get(f"/v1/campaigns/{campaign}/curves", params={"points": points})
    assert response.status_code == 422
    assert response.json()["errors"][0]["field"] == "points"
