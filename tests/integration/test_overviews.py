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
