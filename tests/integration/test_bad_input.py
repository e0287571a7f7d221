"""Mistakes that users can make, and what the service answers."""

import json

import httpx
import psutil
import pytest

from tests.hostile_formulas import formulas


def low(**spec):
    return json.dumps({"families": ["low"]} | spec)


def requirement(formula):
    return low(requirements=[{"name": "mine", "formula": formula, "scale": 1.0}])


@pytest.mark.parametrize(
    ("body", "field", "got", "wanted"),
    [
        ("{}", "families", "nothing", "a value"),
        ("[]", "", "[]", "a JSON object"),
        ('{"families": ["high"]}', "families[0]", "'high', which is no scenario", "one of low, mixed, dense,"),
        ('{"families": []}', "families", "[]", "at least 1 entries"),
        ('{"families": ["low", "low"]}', "families", "['low', 'low']", "each value once"),
        (low(methods=["sca"]), "methods[0]", '"sca"', "'risk-sac'"),
        (low(episodes=3), "episodes", "3", "one of boundary, budget"),
        (
            low(budget={"episods": 3}),
            "budget.episods",
            "3",
            "one of all_points, batch, cpu_s, episodes, evaluation_episodes, least_episodes",
        ),
        (low(budget={"episodes": -1}), "budget.episodes", "-1", ">= 1"),
        (low(budget={"episodes": 3, "least_episodes": 4}), "budget", "4", "at most episodes, 3"),
        (low(budget={"episodes": "3"}), "budget.episodes", '"3"', "an integer"),
        (low(budget={"episodes": float("nan")}), "budget.episodes", "NaN", "an integer"),
        (low(ego={"reaction_time_s": float("nan")}), "ego.reaction_time_s", "NaN", "a finite number"),
        (low(ego={"reaction_time_s": float("inf")}), "ego.reaction_time_s", "Infinity", "a finite number"),
        (low(ego={"reaction_time_s": 0.55}), "ego.reaction_time_s", "0.55", "a multiple of the 0.1 s"),
        (low(seeds=[-1]), "seeds[0]", "-1", ">= 0"),
        (low(label="x" * 201), "label", '"xxx', "at most 200 characters"),
        (low(label="a\x00b"), "label", '"a\\u0000b"', "text without NUL"),
        (low(tags=["Nightly run"]), "tags[0]", '"Nightly run"', "lowercase letters, digits"),
        (low(tags=["a"] * 2), "tags", "['a', 'a']", "each value once"),
        (low(odd={"environment": {"friction": {"low": 2, "high": 1}}}), "odd.environment.friction", "2", "low <= high"),
        (low(odd={"dynamic": {"ego_speed_mps": {"low": 60, "high": 70}}}), "odd.dynamic.ego_speed_mps", "", ""),
        (requirement("ttc_s >="), "requirements[0].formula", "'the end'", "a signal, a number or '('"),
        (requirement("sped > 1"), "requirements[0].formula", "", ""),
        (requirement("always (ttc_s > 1)"), "requirements[0].formula", "", ""),
        (requirement("once[0:500] (ttc_s > 1)"), "requirements[0].formula", "", ""),
    ],
)
def test_a_bad_campaign_is_refused_by_field_got_and_wanted(client, body, field, got, wanted):
    response = client.post("/v1/campaigns", content=body, headers={"content-type": "application/json"})
    assert response.status_code == 422, response.text
    assert response.headers["content-type"] == "application/problem+json"
    problem = response.json()
    assert problem["instance"] == "/v1/campaigns"
    (error,) = problem["errors"]
    assert error["field"].startswith(field)
    assert got in error["got"]
    assert wanted in error["wanted"]
    assert error["wanted"]
    assert error["message"] in problem["detail"]
    assert_checked_alike(client, body, problem)


@pytest.mark.parametrize(
    ("body", "detail"),
    [
        (b"", "EOF while parsing"),
        (b'{"families": ["low"', "EOF while parsing"),
        (b"families: [low]", "expected ident"),
        (b'{"label": "\xff"}', "the body is no JSON"),
        (b"[" * 100_000, "recursion limit"),
        (b'{"seeds": [' + b"9" * 5000 + b"]}", "number out of range"),
        (b'{"label": "\\ud800"}', "hex escape"),
    ],
)
def test_a_body_that_is_no_json_is_refused(client, body, detail):
    response = client.post("/v1/campaigns", content=body, headers={"content-type": "application/json"})
    assert (response.status_code, response.json()["reason"]) == (400, "malformed_json")
    assert detail in response.json()["detail"]
    assert_checked_alike(client, body, response.json())


TRIAGE = "/v1/campaigns/c0/failures/f0/triage"


def nested(opening, depth, closing):
    return b'{"network": "x", "a": ' + opening * depth + b"1" + closing * depth + b"}"


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (json.dumps({"network": "x"} | {f"field{i}": i for i in range(20_000)}).encode(), 422),
        (json.dumps({"network": "x"} | {f"f{i}": 0 for i in range(60_000)}).encode(), 422),
        (json.dumps({"families": [[]] * 250_000}).encode(), 422),
        (json.dumps({"families": ["low"], "seeds": [[]] * 4000}).encode(), 422),
        (json.dumps({"families": [[]] * 4000, "network": "x"}).encode(), 422),
        (nested(b'{"a": ', 948, b"}"), 400),
        (nested(b'{"a": ', 140_000, b"}"), 400),
        (nested(b"[", 990, b"]"), 400),
        (nested(b"[", 150, b"]"), 422),
        (b'{"a": ' * 948 + b"1" + b"}" * 948, 400),
    ],
    ids=lambda each: str(each)[:40],
)
def test_a_hostile_body_costs_no_more_than_its_size(shared, client, body, status):
    server = psutil.Process(shared.process.pid)
    for method, path in (("POST", "/v1/campaigns"), ("POST", "/v1/regressions"), ("PUT", TRIAGE)):
        before = sum(server.cpu_times()[:2])
        response = client.request(method, path, content=body, headers={"content-type": "application/json"})
        assert response.status_code == status, response.text
        assert len(response.json()["detail"]) < 20_000
        assert sum(server.cpu_times()[:2]) - before < 0.5


def assert_checked_alike(client, body, problem):
    """Whether a check alone says the same."""
    path = "/v1/campaigns/check"
    checked = client.post(path, content=body, headers={"content-type": "application/json"})
    assert checked.headers["content-type"] == "application/problem+json"
    assert checked.json() == problem | {"instance": path}


def test_a_check_keeps_nothing_and_needs_no_key(client):
    def campaigns():
        return client.get("/v1/campaigns").json()["items"]

    before = campaigns()
    for headers in ({}, {"idempotency-key": "nightly"}):
        body = {"families": ["dense"], "methods": ["random"], "label": "never"}
        answer = client.post("/v1/campaigns/check", json=body, headers=headers)
        assert (answer.status_code, answer.json()["adjustments"]) == (200, [])
    assert campaigns() == before
    posted = client.post("/v1/campaigns", json={"families": ["low"]}, headers={"idempotency-key": "nightly"})
    assert posted.status_code == 202, "the key is still free"
    client.post(f"{posted.headers['location']}/cancel")
    assert client.get("/v1/campaigns/check").json()["reason"] == "unknown_id", "no campaign is called so"
    assert client.post("/v1/campaigns/check", content=b"{}").status_code == 415


def test_every_mistake_is_named_at_once(client):
    body = low(budget={"episodes": 0, "evaluation_episodes": -1}, seeds=[1.5])
    problem = client.post("/v1/campaigns", content=body, headers={"content-type": "application/json"}).json()
    fields = [error["field"] for error in problem["errors"]]
    assert fields == ["seeds[0]", "budget.episodes", "budget.evaluation_episodes"]


def test_a_body_of_another_type_is_refused(client):
    response = client.post("/v1/campaigns", content=low(), headers={"content-type": "text/plain"})
    assert (response.status_code, response.json()["reason"]) == (415, "unsupported_media_type")
    assert response.headers["content-type"] == "application/problem+json"
    assert "got" not in response.json()["detail"]
    assert "'text/plain'; wanted application/json" in response.json()["detail"]


def post(client: httpx.Client, body: str, path: str = "/v1/campaigns") -> httpx.Response:
    return client.post(path, content=body, headers={"content-type": "application/json"})


def odd(text: str) -> str:
    return f'{{"families": ["low"], "odd": {text}}}'


def friction(low: str, high: str = "1") -> str:
    return odd(f'{{"environment": {{"friction": {{"low": {low}, "high": {high}}}}}}}')


@pytest.mark.parametrize(
    "body",
    [
        friction("NaN"),
        friction("0.5", "1e999"),
        friction("0.5", "9" * 5000),
        friction("1e-300", "1e-299"),
        friction("[0.5]"),
        odd('{"environment": {"friction": {"low": 0.5}}}'),
        odd('{"environment": {"__class__": {"__init__": {}}}}'),
        odd('{"\\u0000": 1}'),
        odd(f'{{"{"x" * 900_000}": 1}}'),
        odd(f'{{"dynamic": {{"actor_kinds": {json.dumps(["ox"] * 100_000)}}}}}'),
        odd('{"dynamic": {"actor_kinds": ["\\ud800"]}}'),
        odd("[" * 100_000 + "]" * 100_000),
        odd('{"environment": ' * 50_000 + "{}" + "}" * 50_000),
        odd('{"environment": {"friction": {"low": 0.5, "high": 0.9, "low": 0.6}}}'),
        odd('{"scenery": {"lanes": {"low": 9, "high": 10}}}'),
    ],
    ids=lambda body: body[29:60],
)
def test_a_hostile_odd_is_refused_with_its_reason(client, body):
    response = post(client, body)
    assert response.status_code in (400, 422), response.text[:500]
    assert response.headers["content-type"] == "application/problem+json"
    assert 0 < len(response.json()["detail"]) < 5000


def test_hostile_formulas_are_refused_or_taken(client):
    every = formulas()
    outcomes = []
    for formula in every[:: len(every) // 60]:
        requirement = {"name": "mine", "formula": formula, "scale": 1}
        spec = {"families": ["low"], "methods": ["random"], "budget": {"episodes": 1}, "requirements": [requirement]}
        response = post(client, json.dumps(spec), "/v1/campaigns/check")
        assert response.status_code in (200, 400, 422), f"{formula!r}: {response.text[:500]}"
        if response.status_code == 422:
            assert response.json()["errors"][0]["field"] == "requirements[0].formula"
        outcomes.append(response.status_code)
    assert outcomes.count(422) > 25
    assert outcomes.count(200) > 5
    assert client.get("/healthz").status_code == 200
