"""Scenarios of a user's own on a real server."""

import io
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import yaml

from risk_sac.client import Client, Refused
from risk_sac.failures.scenario_trial import scenario_png
from risk_sac.scenario.reading import document_from, nets_of, shipped_document
from tests.hostile_networks import zipped
from tests.openscenario_samples import FILES, SCENARIO, VARIATION, copied

NET = (Path(__file__).parents[2] / "sumo_nets/low/low.net.xml").read_text()
DOCUMENT: dict[str, Any] = {
    "name": "braking_van",
    "summary": "A van ahead of the ego brakes.",
    "tags": ["iso34502:deceleration"],
    "network": "low",
    "horizon_s": 4,
    "parameters": {"gap": {"unit": "m", "range": [20, 50]}},
    "ego": {"start": {"lane": "road_1", "at_m": 200}, "speed": 12},
    "actors": {"van": {"body": "van", "start": {"ahead_of": "ego", "gap_m": "gap"}, "speed": 12}},
}
CAMPAIGN = {"methods": ["random"], "budget": {"episodes": 2}}


def post(shared, document: object, path: str = "/v1/scenarios"):
    return shared.client.post(path, json=document, timeout=120)


def test_posted_scenario_is_listed_drawn_searched_and_deleted(shared):
    answer = post(shared, DOCUMENT)
    assert answer.status_code == 201, answer.text
    scenario = answer.json()
    name = scenario["name"]
    assert answer.headers["location"] == f"/v1/scenarios/{name}"
    assert post(shared, DOCUMENT).status_code == 200
    assert document_from(scenario["document"]).name == "braking_van"
    rows = {row["name"]: row for row in shared.client.get("/v1/scenarios").json()["items"]}
    assert rows["low"]["shipped"]
    assert not rows[name]["shipped"]
    assert rows[name]["actors"] == ["van"]
    assert rows[name]["parameters"][0]["range"] == [20, 50]
    picture = shared.client.get(f"/v1/scenarios/{name}/picture.png", timeout=120)
    assert picture.headers["content-type"] == "image/png"
    assert picture.content.startswith(b"\x89PNG")

    campaign = shared.client.post("/v1/campaigns", json=CAMPAIGN | {"scenarios": [name]})
    assert campaign.status_code == 202, campaign.text
    assert campaign.json()["spec"]["families"] == [name]
    assert shared.client.delete(f"/v1/scenarios/{name}").status_code == 409

    other = post(shared, DOCUMENT | {"name": "unused"}).json()["name"]
    assert shared.client.delete(f"/v1/scenarios/{other}").status_code == 204
    assert shared.client.get(f"/v1/scenarios/{other}").status_code == 404
    assert shared.client.post("/v1/campaigns", json=CAMPAIGN | {"scenarios": [other]}).status_code == 422


def test_a_scenario_deleted_while_it_is_read_or_drawn_is_unknown(shared):
    for attempt in range(3):
        name = post(shared, DOCUMENT | {"name": f"gone_{attempt}"}).json()["name"]
        paths = [f"/v1/scenarios/{name}"] * 3 + [f"/v1/scenarios/{name}/picture.png"]
        statuses = set[int]()

        def read_until_gone(path: str, statuses: set[int] = statuses) -> None:
            status = 0
            while status != 404:
                status = shared.client.get(path, timeout=120).status_code
                statuses.add(status)

        with ThreadPoolExecutor(len(paths)) as readers:
            reads = [readers.submit(read_until_gone, path) for path in paths]
            time.sleep(0.2 * attempt)
            assert shared.client.delete(f"/v1/scenarios/{name}").status_code == 204
            for read in reads:
                read.result()
        assert statuses <= {200, 404}, statuses


def test_net_comes_in_an_archive(shared):
    document = yaml.safe_dump(DOCUMENT | {"name": "own_road", "network": "road.net.xml"})
    content = zipped(document, NET, names=("own_road.yaml", "road.net.xml"))
    headers = {"content-type": "application/zip"}
    answer = shared.client.post("/v1/scenarios", content=content, headers=headers, timeout=120)
    assert answer.status_code == 201, answer.text
    answer = post(shared, DOCUMENT | {"name": "own_road", "network": "road.net.xml"})
    assert answer.json()["errors"][0]["field"] == "network"


def test_net_whose_ending_the_document_leaves_out_is_named(shared):
    document = yaml.safe_dump(DOCUMENT | {"name": "own_road", "network": "road"})
    content = zipped(document, NET, names=("own_road.yaml", "road.net.xml"))
    answer = shared.client.post("/v1/scenarios", content=content, headers={"content-type": "application/zip"})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "network"
    assert "did you mean network: road.net.xml?" in answer.json()["detail"]


def archive_of(folder: Path) -> bytes:
    """Zips the files of a folder."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for file in sorted(path for path in folder.rglob("*") if path.is_file()):
            archive.write(file, file.relative_to(folder))
    return buffer.getvalue()


def test_openscenario_comes_in_an_archive(shared):
    headers = {"content-type": "application/zip"}
    answer = shared.client.post("/v1/scenarios", content=archive_of(FILES), headers=headers, timeout=120)
    assert answer.status_code == 201, answer.text
    document = document_from(answer.json()["document"])
    assert document.road == "road.xodr"
    assert document.origin is not None
    assert document.origin.file == VARIATION
    assert answer.json()["actors"] == ["Cutting_in", "Walker", "Box"]


@pytest.mark.parametrize(("declared", "status"), [("application/xml", 415), ("application/yaml", 422)])
def test_openscenario_without_its_archive_is_told_to_be_zipped(shared, declared, status):
    headers = {"content-type": declared}
    answer = shared.client.post("/v1/scenarios", content=b"<?xml version='1.0'?><OpenSCENARIO/>", headers=headers)
    assert answer.status_code == status
    assert "goes into a zip archive" in answer.json()["detail"]


def test_ego_of_openscenario_is_chosen_by_name(shared):
    answer = shared.client.post(
        "/v1/scenarios/check",
        content=archive_of(FILES),
        params={"ego_entity": "Nobody"},
        headers={"content-type": "application/zip"},
        timeout=120,
    )
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["field"].startswith("cut_in.xosc")
    assert "Nobody" in error["got"]


def test_fault_of_openscenario_is_named_by_line(shared, tmp_path):
    files = copied(tmp_path, (SCENARIO, "${$gap + 5}", "${$gab + 5}"))
    headers = {"content-type": "application/zip"}
    answer = shared.client.post("/v1/scenarios", content=archive_of(files), headers=headers, timeout=120)
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["field"] == "cut_in.xosc, line 69, <RelativeLanePosition>"
    assert error["got"] == "ds: $gab, which is no parameter"


@pytest.mark.parametrize("path", ["/v1/scenarios", "/v1/scenarios/check"])
def test_fault_is_named_and_nothing_is_stored(shared, path):
    before = shared.client.get("/v1/scenarios").json()
    actors = {"van": DOCUMENT["actors"]["van"] | {"start": {"lane": "rode_1", "at_m": 240}}}
    answer = post(shared, DOCUMENT | {"actors": actors}, path)
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert (error["field"], error["got"]) == ("actors.van.start.lane", "'rode_1'")
    assert "road_1" in answer.json()["detail"]
    assert shared.client.get("/v1/scenarios").json() == before


@pytest.mark.parametrize("packed", [False, True])
def test_document_of_ten_megabytes_is_refused_in_one_line(shared, packed):
    text = yaml.safe_dump(DOCUMENT).replace(DOCUMENT["summary"], "x" * 10_000_000)
    body = zipped(text, names=("scenario.yaml",)) if packed else text.encode()
    kind = {"content-type": "application/zip" if packed else "application/yaml"}
    for path in ("/v1/scenarios", "/v1/scenarios/check"):
        answer = shared.client.post(path, content=body, headers=kind, timeout=120)
        assert answer.status_code == 422
        fault = answer.json()["errors"][0]
        assert (fault["field"], fault["got"]) == ("document", f"{len(text)} bytes")
        assert len(fault["message"]) < 120
        assert "\n" not in fault["message"]


def test_check_plays_scenes(shared):
    answer = post(shared, DOCUMENT | {"name": "checked_only"}, "/v1/scenarios/check")
    assert answer.status_code == 200, answer.text
    assert answer.json()["played"] == 20
    assert answer.json()["contacts"] == 0
    assert answer.json()["remarks"] == []


def test_several_faults_are_all_named(shared):
    answer = post(shared, DOCUMENT | {"colour": 1, "parameters": {"gap": {"range": [9, 1]}}})
    assert {error["field"] for error in answer.json()["errors"]} == {"colour", "parameters.gap.range"}


def test_shipped_scenarios_are_drawn_as_each_is_alone(shared):
    names = ("low", "dense")
    drawn = [shared.client.get(f"/v1/scenarios/{name}/picture.png", timeout=120).content for name in names]
    documents = [shipped_document(name) for name in names]
    assert drawn == [scenario_png(document, nets_of(document)) for document in documents]


def test_shipped_scenario_is_not_deleted(shared):
    answer = shared.client.delete("/v1/scenarios/low")
    assert (answer.status_code, answer.json()["reason"]) == (409, "scenario_in_use")


def test_unknown_scenario_of_a_campaign_lists_those_that_ship(shared):
    answer = shared.client.post("/v1/campaigns", json=CAMPAIGN | {"scenarios": ["mixd"]})
    assert answer.status_code == 422
    assert "did you mean mixed?" in answer.json()["detail"]


def test_client_adds_and_deletes(shared):
    with Client(str(shared.client.base_url)) as client:
        kept = client.add_scenario(document_from(yaml.safe_dump(DOCUMENT | {"name": "of_the_client"})))
        assert kept.name in [row.name for row in client.scenarios()]
        assert client.scenario(kept.name).document == kept.document
        client.delete_scenario(kept.name)
        with pytest.raises(Refused):
            client.scenario(kept.name)
