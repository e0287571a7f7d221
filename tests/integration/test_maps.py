"""A map of one's own: over REST, and turned to any side."""

import math
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import sumo_nets
from risk_sac.config import RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.maps.finder import Map
from risk_sac.maps.found import Pattern
from risk_sac.scenario import library
from risk_sac.world.types import Frame
from tests.maps import osm_town, turned
from tests.server import Service

NETS = Path(sumo_nets.__path__[0])
XML = {"content-type": "application/xml"}
STEPS = 60


def played(net: Path, pattern: Pattern, place: str, seed: int) -> list[Frame]:
    chosen = Map(net)
    family = chosen.keep(chosen.fits(pattern, place)[0])
    spec = RunSpec(family=family, method="random", seed=0)
    draw = np.random.default_rng(seed)
    with closing(RiskSacEnv(Problem.from_spec(spec), spec.learner.reward)) as env:
        scene = env.problem.space.from_unit(draw.uniform(0.4, 0.6, env.problem.space.dimension))
        env.reset(seed=seed, options={"scene": scene})
        for _ in range(STEPS):
            if env.step(draw.uniform(-1, 1, env.action_size).astype(np.float32))[2]:
                break
        return list(env.trace.frames)


@pytest.mark.parametrize("degrees", [37, -101])
@pytest.mark.parametrize(
    ("net", "pattern", "place"),
    [("low", "car_following", "road"), ("mixed", "crossing", "e1"), ("dense", "junction", "from_south")],
)
def test_an_episode_is_the_same_in_whichever_direction_its_map_lies(
    tmp_path, monkeypatch, net, pattern, place, degrees
):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    file, angle = NETS / net / f"{net}.net.xml", math.radians(degrees)
    other = tmp_path / "turned.net.xml"
    other.write_text(turned(file.read_text(), angle))
    straight, slanting = played(file, pattern, place, 4), played(other, pattern, place, 4)
    assert len(straight) == len(slanting)
    cos, sin = math.cos(angle), math.sin(angle)
    for a, b in zip(straight, slanting, strict=True):
        np.testing.assert_allclose(a.x_m * cos - a.y_m * sin, b.x_m, atol=0.05)
        np.testing.assert_allclose(a.x_m * sin + a.y_m * cos, b.y_m, atol=0.05)
        np.testing.assert_allclose(a.speed_mps, b.speed_mps, atol=0.01)
        assert (a.signal, a.link.tobytes()) == (b.signal, b.link.tobytes())


def test_from_an_extract_of_a_town_to_the_results_of_a_campaign_on_it(shared):
    service = shared
    taken = service.client.post("/v1/networks", content=osm_town(), headers=XML)
    assert taken.status_code == 201, taken.text
    assert any("angle" in warning for warning in taken.json()["warnings"])
    assert any("on which side people drive" in warning for warning in taken.json()["warnings"])
    home = taken.headers["location"]
    places = service.client.get(f"{home}/places").raise_for_status().json()
    assert {place["pattern"] for place in places["items"]} == {"car_following", "crossing", "junction"}
    assert all(each["why"] for each in places["elsewhere"])
    assert service.client.get(f"{home}/places.png").content.startswith(b"\x89PNG")
    ground_m = service.client.get(f"{home}/roads").raise_for_status().json()["surfaces"]
    corners = np.array([corner for surface in ground_m for corner in surface["outline"]])
    for place in places["items"] + places["elsewhere"]:  # each lies on the roads that are drawn
        assert np.linalg.norm(corners - (place["x_m"], place["y_m"]), axis=1).min() < 150
    place = next(place for place in places["items"] if place["pattern"] == "junction")
    ground = {"network": taken.json()["id"], "pattern": "junction"}
    body = ground | {"place": place["place"], "methods": ["random"], "budget": {"episodes": 3}}
    campaign = service.client.post("/v1/campaigns", json=body).raise_for_status().json()
    assert campaign["families"][0].startswith("junction_")
    service.wait_until(lambda: service.get(campaign["id"])["state"] == "succeeded")
    (run,) = service.get(campaign["id"], "/results")["runs"]
    assert run["metrics"]["episodes"] == 3
    spec = service.get(campaign["id"], "/spec")  # holds the family's name, and can be posted again
    assert service.client.post("/v1/campaigns/check", json=spec).status_code == 200
    _refuses(service, ground)


def _refuses(service: Service, ground: dict[str, str]) -> None:
    for change, field, says in [
        ({"place": "nowhere"}, "place", "the map has no edge 'nowhere'"),
        ({"place": "-1#0", "pattern": "jump"}, "pattern", "car_following"),
        ({"place": "1", "places": "all"}, "place", "either place"),
        ({}, "place", "either place"),
        ({"place": "1", "network": "n0"}, "network", "GET /v1/networks"),
        ({"place": "1", "families": ["low"]}, "families", "not both"),
    ]:
        answer = service.client.post("/v1/campaigns/check", json=ground | change)
        assert answer.status_code == 422, answer.text
        assert says in answer.text
        assert answer.json()["errors"][0]["field"] == field, answer.text
    answer = service.client.post("/v1/campaigns/check", json={"families": ["junction_000000000000"]})
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "families[0]")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ('<!DOCTYPE osm [<!ENTITY a SYSTEM "file:///etc/passwd">]><osm>&a;</osm>', "got a DOCTYPE in line 1"),
        ("<osm><node", "no well-formed XML"),
        ('<OpenDRIVE><road id="2" rule="LHT"/></OpenDRIVE>', "left-hand traffic (rule=LHT)"),
        ("<osm></osm>", "the upload without roads"),
        ("<OpenDRIVE>" + "<road>" * 30 + "</road>" * 30 + "</OpenDRIVE>", "nested more than 20 deep"),
        ("<OpenDRIVE><include file='/etc/passwd'/><road/></OpenDRIVE>", "got road '?'"),
    ],
)
def test_a_map_that_cannot_be_converted_says_why(client, content, says):
    answer = client.post("/v1/networks", content=content, headers=XML)
    assert answer.status_code == 422, answer.text
    assert says in answer.json()["detail"]
