"""Boundary map over REST and on the command line, with real workers."""

import json

import pytest

from risk_sac import cli
from risk_sac.records.rates import BoundaryMap

OVER = ("ego_speed_mps", "cutter_ahead_m")
SPEC = {"families": ["motorway_cut_in"], "methods": ["boundary", "random"], "seeds": [0], "budget": {"episodes": 6}}
SPEC |= {"boundary": {"over": OVER}}


@pytest.fixture
def get(service, campaign):
    path = f"/v1/campaigns/{campaign['id']}/runs/motorway_cut_in-"
    return lambda what, method="boundary": service.client.get(f"{path}{method}-0/{what}")


def test_a_run_has_its_map_and_a_picture(get):
    found = BoundaryMap.model_validate_json(get("boundary").content)
    assert tuple(axis.name for axis in found.axes) == OVER
    assert len(found.points) == 6
    picture = get("boundary.png")
    assert picture.headers["content-type"] == "image/png"
    assert picture.content.startswith(b"\x89PNG")


def test_a_run_of_another_method_has_none(get):
    answer = get("boundary", "random")
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (404, "run_id")


@pytest.mark.parametrize(
    ("over", "field"),
    [(["cutter_ahead_m", "gap"], "boundary.over"), (["cutter_ahead_m"], "boundary.over"), (None, "boundary")],
)
def test_what_has_no_boundary_is_refused_and_not_stored(service, over, field):
    before = len(service.client.get("/v1/campaigns").json()["items"])
    body = {"families": ["motorway_cut_in"], "methods": ["boundary"]} | ({"boundary": {"over": over}} if over else {})
    answer = service.client.post("/v1/campaigns", json=body)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"].startswith(field)
    assert len(service.client.get("/v1/campaigns").json()["items"]) == before


def test_the_command_draws_a_second_ego_beside_the_first(tmp_path, capsys):
    command = ["boundary", "motorway_cut_in", "--over", *OVER, "--episodes", "4", "--out", str(tmp_path), "--json"]
    assert cli.main([*command, "--ego", "idm-aeb", "--beside", "r157"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [told["name"] for told in found["maps"]] == ["ego", "r157", "fsm", "r157"]
    assert (tmp_path / "boundary.png").is_file()
    assert cli.main([*command, "--at", "friction"]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
