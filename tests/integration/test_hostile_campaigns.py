"""Campaigns whose ODD or formulas want to do harm, posted to a real server."""

import json

import httpx
import pytest

from tests.hostile_formulas import formulas

LONG = "x" * 900_000


def odd(text: str) -> str:
    return f'{{"families": ["low"], "odd": {text}}}'


def friction(low: str, high: str = "1") -> str:
    return odd(f'{{"environment": {{"friction": {{"low": {low}, "high": {high}}}}}}}')


def kinds(text: str) -> str:
    return odd(f'{{"dynamic": {{"actor_kinds": {text}}}}}')


ODDS = {
    "NaN": friction("NaN"),
    "infinity": friction("0.5", "Infinity"),
    "minus infinity": friction("-Infinity"),
    "1e308": friction("0.5", "1e308"),
    "1e999": friction("0.5", "1e999"),
    "-1e308": friction("-1e308"),
    "5,000 digits": friction("0.5", "9" * 5000),
    "a millionth of a millionth": friction("1e-300", "1e-299"),
    "upside down": friction("1", "0.5"),
    "upside down by nothing": friction("0.50000000000000011", "0.5"),
    "a text for a number": friction('"0.5"'),
    "a truth for a number": friction("true"),
    "nothing for a number": friction("null"),
    "a list for a number": friction("[0.5]"),
    "an object for a number": friction('{"low": 0.5}'),
    "one bound": odd('{"environment": {"friction": {"low": 0.5}}}'),
    "a list for an interval": odd('{"environment": {"friction": [0.5, 1]}}'),
    "a number for a branch": odd('{"environment": 7}'),
    "a list for all": odd("[]"),
    "nothing for all": odd("null"),
    "unknown branch": odd('{"weather": {"rain": 1}}'),
    "unknown field": odd('{"environment": {"rain": {"low": 0, "high": 1}}}'),
    "field of Python's": odd('{"environment": {"__class__": {"__init__": {}}}}'),
    "field of JavaScript's": odd('{"__proto__": {"polluted": true}}'),
    "field with NUL": odd('{"\\u0000": 1}'),
    "field of 900,000 characters": odd(f'{{"{LONG}": 1}}'),
    "text of 900,000 characters": kinds(f'["{LONG}"]'),
    "list of 200,000": kinds(f"[{', '.join(['1'] * 200_000)}]"),
    "list of 100,000 unknown": kinds(json.dumps(["ox"] * 100_000)),
    "half a character": kinds('["\\ud800"]'),
    "look-alike letters": kinds('["pedestri\\u0430n"]'),
    "no kinds": kinds("[]"),
    "lists in lists": odd("[" * 100_000 + "]" * 100_000),
    "objects in objects": odd('{"environment": ' * 50_000 + "{}" + "}" * 50_000),
    "twice the same field": odd('{"environment": {"friction": {"low": 0.5, "high": 0.9, "low": 0.6}}}'),
    "twice the same branch": odd('{"environment": {}, "environment": {"friction": {"low": 0.5, "high": 1}}}'),
    "1.5 lanes of 10^9": odd('{"scenery": {"lanes": {"low": 1.5, "high": 1000000000}}}'),
    "faster than light": odd('{"dynamic": {"ego_speed_mps": {"low": 0, "high": 300000000}}}'),
    "nobody can brake": odd('{"dynamic": {"vehicle_accel_mps2": {"low": 1, "high": 2}}}'),
    "nothing is left": odd('{"scenery": {"lanes": {"low": 9, "high": 10}}}'),
}


def post(client: httpx.Client, body: str) -> httpx.Response:
    return client.post("/v1/campaigns", content=body, headers={"content-type": "application/json"})


@pytest.mark.parametrize("name", ODDS)
def test_a_hostile_odd_is_refused_with_its_reason(client: httpx.Client, name: str) -> None:
    response = post(client, ODDS[name])
    assert response.status_code in (400, 422), response.text[:500]
    assert response.headers["content-type"] == "application/problem+json"
    assert 0 < len(response.json()["detail"]) < 5000
    assert client.get("/healthz").status_code == 200


def test_there_are_more_than_20_of_them() -> None:
    assert len(set(ODDS.values())) >= 20


def test_hostile_formulas_are_refused_or_queued(client: httpx.Client) -> None:
    every = formulas()
    outcomes = []
    for formula in every[:: len(every) // 60]:
        requirement = {"name": "mine", "formula": formula, "scale": 1}
        spec = {"families": ["low"], "methods": ["random"], "budget": {"episodes": 1}, "requirements": [requirement]}
        response = post(client, json.dumps(spec))
        assert response.status_code in (202, 400, 422), f"{formula!r}: {response.text[:500]}"
        if response.status_code == 422:
            assert response.json()["errors"][0]["field"] == "requirements[0].formula"
        outcomes.append(response.status_code)
    assert len(outcomes) >= 50
    assert outcomes.count(422) > 25
    assert outcomes.count(202) > 5
    assert client.get("/healthz").status_code == 200
