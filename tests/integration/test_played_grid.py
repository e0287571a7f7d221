"""Verdicts on a sweep's scenes over REST, with real server and worker."""

import csv
import io

import pytest
from junitparser import JUnitXml

SPEC = {"families": ["motorway_cut_in"], "methods": ["story-sweep", "random"], "seeds": [0], "budget": {"episodes": 4}}


@pytest.fixture
def get(service, campaign):
    path = f"/v1/campaigns/{campaign['id']}/runs"
    return lambda method="story-sweep", **query: service.client.get(
        f"{path}/motorway_cut_in-{method}-0/grid", params=query
    )


def test_each_scene_has_a_verdict(get):
    grid = get().json()
    assert grid["spec"]["method"] == "story-sweep"
    assert len(grid["points"]) == 4
    assert {point["verdict"] for point in grid["points"]} <= {"pass", "fail", "out_of_scope", "refused", "unjudged"}
    assert get(standard="fsm").json()["standard"] == "fsm"


def test_formats_have_the_same_scenes(get):
    ids = [point["id"] for point in get().json()["points"]]
    table = get(format="csv")
    assert table.headers["content-type"] == "text/csv; charset=utf-8"
    assert [row["id"] for row in csv.DictReader(io.StringIO(table.text))] == ids
    report = JUnitXml.fromstring(get(format="xml").content)
    cases = [case for suite in report for case in suite]
    assert len(cases) == len(ids)


def test_picture_is_over_two_parameters(get):
    names = list(get().json()["points"][0]["values"])
    picture = get(format="png", over=names[:2])
    assert picture.headers["content-type"] == "image/png"
    assert picture.content.startswith(b"\x89PNG")
    refused = get(format="png", over=[names[0], "nothing"])
    assert (refused.status_code, refused.json()["errors"][0]["field"]) == (422, "over")


def test_answer_is_not_sent_twice(get, service):
    first = get()
    again = service.client.get(first.request.url, headers={"if-none-match": first.headers["etag"]})
    assert again.status_code == 304


def test_run_of_another_method_is_refused(get):
    for method in ("random", "archive"):
        answer = get(method)
        assert (answer.status_code, answer.json()["errors"][0]["field"]) == (404, "run_id")
