import json
import re
import shlex
from pathlib import Path

import httpx
import pytest
import schemathesis
import yaml
from pydantic import BaseModel

from risk_sac.config import CampaignSpec, LearnerConfig, Odd
from service.api.description import CAMPAIGNS as EXAMPLES
from service.api.routes import events
from service.app import create_app, openapi
from service.openapi import document
from service.settings import ServiceSettings

COMMITTED = Path(__file__).parents[2] / "openapi.yaml"

UPLOADS = ["application/gzip", "application/x-gzip", "application/zip"]
schemathesis.serializer.alias(UPLOADS, "application/octet-stream")


@pytest.fixture(scope="module")
def schema():
    return schemathesis.openapi.from_dict(openapi(create_app(ServiceSettings())))


def test_committed_document_is_what_the_app_generates():
    assert COMMITTED.read_text(encoding="utf-8") == document(), "run `python -m service.openapi`"


def test_served_document_is_the_committed_one(base_url):
    assert httpx.get(f"{base_url}/openapi.json", timeout=120).json() == yaml.safe_load(
        COMMITTED.read_text(encoding="utf-8")
    )


def test_the_document_is_small():
    assert COMMITTED.stat().st_size <= 231_500


def operations():
    document = yaml.safe_load(COMMITTED.read_text(encoding="utf-8"))
    return [(method, path, each) for path, found in document["paths"].items() for method, each in found.items()]


@pytest.mark.parametrize(("method", "path", "operation"), operations(), ids=lambda each: str(each)[:60])
def test_every_call_has_a_readable_title_a_description_and_an_example_that_is_understood(
    base_url, method, path, operation
):
    assert re.fullmatch(r"[A-Z].{7,95}", operation["summary"])
    about, _, example = operation["description"].rpartition("\n\nExample: ")
    assert len(about) > 20
    words = shlex.split(example.strip("`"))
    assert words[:2] == ["curl", "-s"]
    address = next(word for word in words if word.startswith("localhost:8000")).replace("localhost:8000", base_url)
    sent = (words.index("-X") + 1) if "-X" in words else None
    assert (words[sent].lower() if sent else "get") == method
    body = json.loads(words[words.index("-d") + 1]) if "-d" in words else None
    if "--data-binary" in words or path == "/v1/campaigns/{campaign_id}/events":
        return
    answer = httpx.request(method, address, json=body, timeout=120)
    unknown_ids = 404 if "{" in path or path == "/v1/regressions" else None
    assert answer.status_code in (200, 201, 202, unknown_ids), answer.text


def test_every_body_that_is_an_example_is_taken(base_url):
    for name, example in EXAMPLES.items():
        answer = httpx.post(f"{base_url}/v1/campaigns/check", json=example, timeout=120)
        wrong = [each["field"] for each in answer.json().get("errors", [])]
        assert wrong == (["network"] if "network" in example else []), (name, answer.text)


def test_every_error_is_declared_as_a_problem():
    document = yaml.safe_load(COMMITTED.read_text(encoding="utf-8"))
    shared = {f"#/components/responses/{name}": each for name, each in document["components"]["responses"].items()}
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            for status, response in operation["responses"].items():
                types = list(shared.get(response.get("$ref"), response).get("content", {}))
                problem = "application/problem+json"
                refused = status == "default" or int(status) >= 400
                assert types == [problem] if refused else problem not in types, (method, path, status)


@pytest.mark.parametrize("path", ["/v1", "/v1/campaigns/", "/v1/campaigns/x/y/z", "/v1/families/low"])
def test_unknown_route_is_a_problem(base_url, path):
    response = httpx.get(base_url + path)
    assert response.status_code == 404
    assert response.headers["content-type"] == "application/problem+json"
    assert response.json()["instance"] == path


def test_wrong_method_is_a_problem_that_names_the_right_ones(base_url):
    response = httpx.delete(f"{base_url}/v1/campaigns")
    assert response.status_code == 405
    assert response.headers["content-type"] == "application/problem+json"
    assert response.headers["allow"] == "GET, HEAD, POST"


@pytest.mark.parametrize(
    "part",
    [
        "",
        "/results",
        "/episodes",
        "/failures",
        "/failure-table",
        "/curves",
        "/power",
        "/table",
        "/rates",
        "/figures",
        "/spec",
    ],
)
def test_answers_about_a_campaign_that_exists_are_as_documented(base_url, schema, part):
    campaign_id = httpx.post(f"{base_url}/v1/campaigns", json={"families": ["dense"]}).json()["id"]
    operation = schema[f"/v1/campaigns/{{campaign_id}}{part}"]["GET"]
    case = operation.Case(path_parameters={"campaign_id": campaign_id})
    response = case.call(base_url=base_url)
    assert response.status_code == 200
    case.validate_response(response)


@pytest.mark.parametrize("model", [CampaignSpec, LearnerConfig, Odd])
def test_an_object_that_is_left_out_is_what_its_own_defaults_make_of_it(model):
    defaults = [field.default for field in model.model_fields.values() if isinstance(field.default, BaseModel)]
    assert defaults == [type(default)() for default in defaults] != []


def test_a_stream_without_news_beats(base_url, monkeypatch):
    assert events.HEARTBEAT_S == 15
    monkeypatch.setattr(events, "HEARTBEAT_S", 0.05)
    campaign_id = httpx.post(f"{base_url}/v1/campaigns", json={"families": ["low"]}).json()["id"]
    beats = 0
    with httpx.stream("GET", f"{base_url}/v1/campaigns/{campaign_id}/events") as stream:
        for line in stream.iter_lines():
            beats += line == ": alive"
            if beats == 3:
                return
    pytest.fail("the stream ended")
