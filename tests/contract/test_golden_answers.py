"""Whole answers of the main routes about known campaigns, headers included.

The recorded answers are `golden/*.json`. After a change of an answer on purpose record it again and review the diff:

    RISK_SAC_RECORD=1 python -m pytest -n 0 tests/contract/test_golden_answers.py

Times and ids are known beforehand, see `recorded_campaigns`. Left out of the bodies are the machine that a report was
made on, and the metrics of this process and of how long requests took. Of the headers, those are compared that are
about the body.
"""

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from risk_sac.execution.helper import HelperResult
from risk_sac.failures.question import REFUSED
from risk_sac.run_folder.results import EPISODES, RESULTS
from service.settings import ServiceSettings
from tests.contract.recorded_campaigns import ENDED_ID, LIVE_ID, Recorded, known_times_and_ids
from tests.contract.serving import serving

GOLDEN = Path(__file__).with_name("golden")
RECORD = os.environ.get("RISK_SAC_RECORD") == "1"
HEADERS = ("allow", "cache-control", "content-type", "etag", "location", "retry-after")
ENDED, LIVE = f"/v1/campaigns/{ENDED_ID}", f"/v1/campaigns/{LIVE_ID}"
ASKED = {
    "metrics": ("GET", "/metrics"),
    "campaigns": ("GET", "/v1/campaigns"),
    "campaign_ended": ("GET", ENDED),
    "results_ended": ("GET", f"{ENDED}/results"),
    "episodes": ("GET", f"{ENDED}/episodes"),
    "failures": ("GET", f"{ENDED}/failures"),
    "failure_table": ("GET", f"{ENDED}/failure-table"),
    "curves": ("GET", f"{ENDED}/curves"),
    "failure": ("GET", f"{ENDED}/failures/low-risk-sac-3-search-1"),
    "events": ("GET", f"{ENDED}/events"),
    "table": ("GET", f"{ENDED}/table"),
    "report": ("GET", f"{ENDED}/report"),
    "post": ("POST", "/v1/campaigns"),
    "check_bad_formula": ("POST", "/v1/campaigns/check"),
}
POSTED = {"families": ["low"], "methods": ["random"], "label": "posted", "budget": {"episodes": 5}}
WRONG = {"name": "gap", "formula": "leader_gap_m > x", "scale": 1}
BODIES = {"post": POSTED, "check_bad_formula": POSTED | {"requirements": [WRONG]}}


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """Client of a service whose known campaigns at work run again."""
    settings = ServiceSettings(data_dir=tmp_path_factory.mktemp("golden"), max_workers=2)
    with known_times_and_ids() as clock:
        Recorded(settings, clock).write()
        with serving(settings) as url, httpx.Client(base_url=url, headers={"Host": "localhost"}, timeout=600) as client:
            deadline = time.monotonic() + 30
            while any(run["state"] != "running" for run in client.get(LIVE).json()["runs"]):
                assert time.monotonic() < deadline, "the live campaign does not run"
                time.sleep(0.02)
            yield client


@pytest.mark.parametrize("name", ASKED)
def test_the_answer_is_the_recorded_one(client, name):
    method, path = ASKED[name]
    answer = shown(client.request(method, path, json=BODIES.get(name)))
    file = GOLDEN / f"{name}.json"
    if RECORD:
        file.parent.mkdir(exist_ok=True)
        file.write_text(json.dumps(answer, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    assert answer == json.loads(file.read_text(encoding="utf-8"))


def test_failures_and_episodes_are_filtered_by_requirement(client):
    for listed in ("failures", "episodes"):
        items = client.get(f"{ENDED}/{listed}", params={"requirement": "no_contact"}).json()["items"]
        assert items
        assert all(item["collision"] is not None for item in items)
        (fast,) = client.get(f"{ENDED}/{listed}", params={"requirement": "never_fast"}).json()["items"]
        assert (fast["failed"], fast["collision"], fast["violations"][0]["time_s"]) == (["never_fast"], None, 1.5)
        problem = client.get(f"{ENDED}/{listed}", params={"requirement": "never_fats"})
        assert problem.status_code == 422
        (error,) = problem.json()["errors"]
        assert (error["field"], error["got"]) == ("requirement", '"never_fats"')
        assert error["wanted"].startswith("one of: no_contact, on_carriageway, ")
        assert error["wanted"].endswith("never_fast")


def choices(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Yields GET parameters with several values: path, parameter and its schema."""

    def resolved(node: dict[str, Any]) -> dict[str, Any]:
        while "$ref" in node:
            place = document
            for part in node["$ref"].split("/")[1:]:
                place = place[part]
            node = place
        return node

    for path, operations in document["paths"].items():
        for parameter in map(resolved, operations.get("get", {}).get("parameters", [])):
            schema = resolved(parameter["schema"])
            some = [resolved(each) for each in schema.get("anyOf", [schema])]
            yield from ((path, parameter, each) for each in some if "enum" in each)


def test_every_choice_that_is_documented_is_accepted_and_no_other(client, monkeypatch):
    refused = HelperResult(status=REFUSED, answer=b"not here", log="")
    monkeypatch.setattr("service.views.on_demand.run_helper", lambda *_, **__: refused)
    ids = {"campaign_id": ENDED_ID, "failure_id": "low-risk-sac-3-search-1", "run_id": "low-risk-sac-3"}
    ids |= {"name": "ecr_low", "format": "png", "twin": "idle"}
    seen = 0
    for path, parameter, schema in choices(client.get("/openapi.json").json()):
        name = parameter["name"]
        for value in [*schema["enum"], "made-up"]:
            given = {name: value}
            query = given if parameter["in"] == "query" else {}
            status = client.get(path.format(**ids | given), params=query).status_code
            assert (status == 422) is (value == "made-up"), (path, given)
            seen += 1
    assert seen > 50


TESTED_APART = (
    "spec",
    "matrix",
    "cases",
    "signed",
)  # parts of a report; the digest differs with each change of the code


def shown(response: httpx.Response) -> dict[str, Any]:
    """Returns what is compared of a response; non-JSON bodies as lines."""
    headers = {name: response.headers[name] for name in HEADERS if name in response.headers}
    if "json" in headers.get("content-type", ""):
        body = response.json()
        body.pop("platform", None)
        if response.url.path.endswith("/report"):
            body = {name: part for name, part in body.items() if name not in TESTED_APART}
    else:
        body = [line for line in response.text.splitlines() if not line.startswith("- platform: ")]
    if response.url.path == "/metrics":
        body = [line for line in body if "risk_sac_" in line and "_request_seconds" not in line]
    return {"status": response.status_code, "headers": headers, "body": body}


RUN = "low-risk-sac-3"


def flip(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 0x80]) + content[middle + 1 :]


def shorten(content: bytes) -> bytes:
    """Whole lines of it."""
    return b"".join(content.splitlines(keepends=True)[:-1])


@pytest.mark.parametrize(("name", "damage"), [(RESULTS, flip), (EPISODES, shorten)])  # each starts a service
def test_a_table_that_cannot_be_made_names_the_damaged_file_and_what_still_works(tmp_path, name, damage):
    settings = ServiceSettings(data_dir=tmp_path, max_workers=1)
    with known_times_and_ids() as clock:
        Recorded(settings, clock).write()
    file = settings.run_folder(ENDED_ID, RUN) / name
    file.write_bytes(damage(file.read_bytes()))
    with serving(settings) as url, httpx.Client(base_url=f"{url}/v1/campaigns/{ENDED_ID}", timeout=600) as client:
        refused = client.get("/export", params={"format": "parquet"})
        assert (refused.status_code, refused.json()["reason"]) == (503, "storage_unavailable")
        assert f"run {RUN}: {name} " in refused.json()["detail"]
        assert "`episodes` of the campaign still lists them all" in refused.json()["detail"]
        assert str(tmp_path) not in refused.text
        assert len(client.get("/episodes").json()["items"]) == 13
