"""Every answer of the service about known campaigns is the recorded one: status, headers and body.

The recorded answers are `golden/*.json`. Whoever changes an answer on purpose records it anew and reviews the diff:

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

from service.settings import ServiceSettings
from tests.contract.recorded_campaigns import CANCELLED_ID, ENDED_ID, LIVE_ID, Recorded, known_times_and_ids
from tests.contract.serving import serving

GOLDEN = Path(__file__).with_name("golden")
RECORD = os.environ.get("RISK_SAC_RECORD") == "1"
HEADERS = ("allow", "cache-control", "content-type", "etag", "location", "retry-after", "vary")
TAGGED_BY_FILE = ("/thumbnail.svg", "/roads")  # by the series' digest: one zlib packs a file otherwise than the next
ENDED, LIVE, CANCELLED = (f"/v1/campaigns/{each}" for each in (ENDED_ID, LIVE_ID, CANCELLED_ID))
ASKED = {
    "entrance": ("GET", "/"),
    "health": ("GET", "/healthz"),
    "readiness": ("GET", "/readyz"),
    "metrics": ("GET", "/metrics"),
    "families": ("GET", "/v1/families"),
    "methods": ("GET", "/v1/methods"),
    "formats": ("GET", "/v1/formats"),
    "networks": ("GET", "/v1/networks"),
    "network_unknown": ("GET", "/v1/networks/n0"),
    "places_unknown": ("GET", "/v1/networks/n0/places"),
    "places_picture_unknown": ("GET", "/v1/networks/n0/places.png"),
    "campaigns": ("GET", "/v1/campaigns"),
    "campaigns_first_page": ("GET", "/v1/campaigns?limit=2"),
    "campaigns_filtered": ("GET", "/v1/campaigns?state=failed&family=low&method=random&label=ended"),
    "campaigns_bad_cursor": ("GET", "/v1/campaigns?cursor=x"),
    "campaigns_bad_field": ("GET", "/v1/campaigns?limit=0&state=done"),
    "campaign_ended": ("GET", ENDED),
    "campaign_live": ("GET", LIVE),
    "campaign_cancelled": ("GET", CANCELLED),
    "campaign_unknown": ("GET", "/v1/campaigns/c0"),
    "results_ended": ("GET", f"{ENDED}/results"),
    "results_live": ("GET", f"{LIVE}/results"),
    "results_cancelled": ("GET", f"{CANCELLED}/results"),
    "episodes": ("GET", f"{ENDED}/episodes"),
    "episodes_of_a_run": ("GET", f"{ENDED}/episodes?run=low-random-3&outcome=safe&limit=2"),
    "episodes_run_unknown": ("GET", f"{ENDED}/episodes?run=x"),
    "failures": ("GET", f"{ENDED}/failures"),
    "failures_raw": ("GET", f"{ENDED}/failures?tier=raw"),
    "failures_judged": ("GET", f"{ENDED}/failures?grade=ideal&broke=red_light&signature=leader"),
    "failure_table": ("GET", f"{ENDED}/failure-table"),
    "failure_table_raw": ("GET", f"{ENDED}/failure-table?tier=raw"),
    "failure_table_unknown": ("GET", "/v1/campaigns/c0/failure-table"),
    "failure_table_bad_field": ("GET", f"{ENDED}/failure-table?tier=all"),
    "curves": ("GET", f"{ENDED}/curves"),
    "curves_of_two_points": ("GET", f"{ENDED}/curves?points=2"),
    "curves_cancelled": ("GET", f"{CANCELLED}/curves"),
    "curves_unknown": ("GET", "/v1/campaigns/c0/curves"),
    "curves_bad_field": ("GET", f"{ENDED}/curves?points=0"),
    "failure": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-1"),
    "failure_degenerate": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-4"),
    "failure_of_the_failed_run": ("GET", f"{ENDED}/failures/low-random-3-train-1"),
    "failure_unknown": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-0"),
    "picture_unknown": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-0/picture.png"),
    "bundle_unknown": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-0/bundle.npz"),
    "export_unknown": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-0/export?format=gif"),
    "export_bad_field": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-1/export?format=parquet"),
    "core_unknown": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-0/core.npz"),
    "region_unknown": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-0/region"),
    "twin_unknown": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-0/twins/idle.png"),
    "twin_play_unknown": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-0/twins/idle"),
    "thumbnail": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-1/thumbnail.svg"),
    "thumbnail_unknown": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-0/thumbnail.svg"),
    "roads_older": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-1/roads"),
    "roads_unknown": ("GET", f"{ENDED}/failures/low-risk-sac-3-train-0/roads"),
    "regression_unknown": ("GET", f"/v1/regressions/{ENDED_ID}-0000000000000000"),
    "log_empty": ("GET", f"{ENDED}/runs/low-risk-sac-3/log"),
    "log_unknown": ("GET", f"{ENDED}/runs/low-risk-sac-4/log"),
    "log_bad_field": ("GET", f"{ENDED}/runs/low-risk-sac-3/log?lines=1001"),
    "events": ("GET", f"{ENDED}/events"),
    "events_cancelled": ("GET", f"{CANCELLED}/events"),
    "episodes_export_live": ("GET", f"{LIVE}/export?format=parquet"),
    "episodes_export_bad_field": ("GET", f"{ENDED}/export?format=gif"),
    "table": ("GET", f"{ENDED}/table"),
    "table_markdown": ("GET", f"{ENDED}/table?format=md"),
    "table_csv": ("GET", f"{ENDED}/table?format=csv"),
    "table_live": ("GET", f"{LIVE}/table"),
    "clusters": ("GET", f"{ENDED}/clusters"),
    "report": ("GET", f"{ENDED}/report"),
    "figures": ("GET", f"{ENDED}/figures"),
    "figure_unknown": ("GET", f"{ENDED}/figures/pie.png"),
    "spec": ("GET", f"{ENDED}/spec"),
    "spec_yaml": ("GET", f"{ENDED}/spec?format=yaml"),
    "triage_unknown": ("PUT", f"{ENDED}/failures/low-risk-sac-3-train-0/triage"),
    "cancel_ended": ("POST", f"{ENDED}/cancel"),
    "delete_live": ("DELETE", LIVE),
    "post": ("POST", "/v1/campaigns"),
    "check": ("POST", "/v1/campaigns/check"),
    "check_bad_formula": ("POST", "/v1/campaigns/check"),
    "route_unknown": ("GET", "/v1/nothing"),
    "method_not_allowed": ("DELETE", "/v1/campaigns"),
}
POSTED = {"families": ["low"], "methods": ["random"], "label": "posted", "budget": {"episodes": 5}}
BODIES = {"post": POSTED, "check": POSTED} | {
    "triage_unknown": {"state": "fixed", "comment": "in 0.2"},
    "check_bad_formula": POSTED | {"requirements": [{"name": "gap", "formula": "leader_gap_m > x", "scale": 1}]},
}


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """A client of a service that has known campaigns, and has put those at work to work again."""
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


def test_every_recorded_answer_is_asked_for():
    assert {file.stem for file in GOLDEN.glob("*.json")} == set(ASKED)


@pytest.mark.skipif(RECORD, reason="records")
def test_every_documented_route_that_is_read_is_asked_for(client):
    """But for pictures, which matplotlib draws as its version does, and egos, whose versions are of their source."""
    paths = client.get("/openapi.json").json()["paths"]
    known = {ENDED_ID: "{campaign_id}", "low-risk-sac-3-train-1": "{failure_id}", "n0": "{network_id}"}
    known |= {
        "low-risk-sac-3-train-0": "{failure_id}",
        "pie.png": "{name}.{format}",
        "idle.png": "{twin}.png",
        "idle": "{twin}",
        "low-risk-sac-3": "{run_id}",
        "low-risk-sac-4": "{run_id}",
    }
    known[f"{ENDED_ID}-0000000000000000"] = "{regression_id}"
    parts = [path.partition("?")[0].split("/") for _, path in ASKED.values()]
    asked = {"/".join(known.get(part, part) for part in each) for each in parts}
    assert {path for path, operations in paths.items() if "get" in operations} <= asked | {"/v1/egos"}


def shown(response: httpx.Response) -> dict[str, Any]:
    """What is compared of a response; a body that is no JSON as its lines."""
    headers = {name: response.headers[name] for name in HEADERS if name in response.headers}
    if "etag" in headers and response.url.path.endswith(TAGGED_BY_FILE):
        headers["etag"] = "…"
    if "json" in headers.get("content-type", ""):
        body = response.json()
        body.pop("platform", None)
    else:
        body = [line for line in response.text.splitlines() if not line.startswith("- platform: ")]
    if response.url.path == "/metrics":
        body = [line for line in body if "risk_sac_" in line and "_request_seconds" not in line]
    return {"status": response.status_code, "headers": headers, "body": body}
