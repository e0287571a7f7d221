"""A user's maps on the page: from file to campaign."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.server import Service
from tests.web.conftest import NET
from tests.web.test_new import curl_body, small


def upload(page: Page, file: Path, label: str = "") -> None:
    page.get_by_label("Map", exact=True).set_input_files(file)
    page.get_by_role("textbox", name="Label").fill(label)
    page.get_by_role("button", name="Upload").click()


@pytest.fixture
def town(tmp_path: Path) -> Path:
    """A map that no other test has uploaded."""
    file = tmp_path / "town.net.xml"
    file.write_bytes(NET.read_bytes() + f"<!-- {tmp_path} -->".encode())
    return file


def test_from_a_file_to_a_campaign_at_one_of_its_places(
    page_at: Callable[..., Page], service: Service, town: Path
) -> None:
    page = page_at("maps")
    upload(page, town, "my town")
    expect(page.get_by_role("heading", level=1)).to_have_text("my town")
    network = page.url.rsplit("/", 1)[1]
    found = service.client.get(f"/v1/networks/{network}/places").raise_for_status().json()["items"]
    places = page.get_by_role("region", name="Places")
    expect(places.get_by_role("heading")).to_have_text(f"{len(found)} places")
    page.get_by_label("Pattern").select_option("junction")
    page.get_by_label("Search").fill("from_north")
    wanted = [each for each in found if each["pattern"] == "junction" and "from_north" in json.dumps(each)]
    expect(places.locator(".spots").first.locator("li")).to_have_count(len(wanted))
    page.get_by_role("link", name="Start a campaign: Junction at from_north").click()
    small(page, episodes=2)
    page.get_by_label("I.i.d. phase: none").check()
    page.locator("#field-iid\\.episodes").fill("3")
    expect(page.locator(".tile").first).to_contain_text("8")  # 2 searched, 2 x 3 drawn
    assert curl_body(page) == {
        "network": network,
        "pattern": "junction",
        "place": "from_north",
        "methods": ["random"],
        "budget": {"episodes": 2},
        "iid": {"episodes": 3},
    }
    page.get_by_role("button", name="Start the campaign").click()
    expect(page).to_have_url(re.compile("#/campaigns/c[0-9a-f]+$"))
    campaign = service.get(page.url.rsplit("/", 1)[1])
    assert campaign["spec"]["iid"]["episodes"] == 3
    assert [family.split("_")[0] for family in campaign["families"]] == ["junction"]
    page.goto(f"{service.client.base_url}/page/#/new?from={campaign['id']}")
    expect(page.get_by_role("checkbox", name=campaign["families"][0])).to_be_checked()  # a clone keeps its place
    service.client.post(f"/v1/campaigns/{campaign['id']}/cancel")


def test_a_click_on_the_map_highlights_the_line_of_a_place_and_the_other_way_round(
    page_at: Callable[..., Page], service: Service, network: str
) -> None:
    page = page_at(f"maps/{network}")
    plan = page.get_by_role("group", name="The map from above")
    expect(page.locator("button.spot")).not_to_have_count(0)
    page.get_by_label("Pattern").select_option("junction")
    found = service.client.get(f"/v1/networks/{network}/places").json()
    shown = [each for each in found["items"] + found["elsewhere"] if each["pattern"] == "junction"]
    expect(plan).to_have_attribute("data-places", str(len(shown)))
    surfaces = service.client.get(f"/v1/networks/{network}/roads").json()["surfaces"]
    x, y = zip(*(corner for surface in surfaces for corner in surface["outline"]), strict=True)
    box = plan.evaluate("each => [each.clientWidth, each.clientHeight]")
    scale = min((box[0] - 48) / (max(x) - min(x)), (box[1] - 48) / (max(y) - min(y)))  # 24 px around the whole map
    place = found["items"][-1]
    assert place["pattern"] == "junction"
    across = box[0] / 2 + (place["x_m"] - (min(x) + max(x)) / 2) * scale
    down = box[1] / 2 - (place["y_m"] - (min(y) + max(y)) / 2) * scale
    plan.click(position={"x": across + 1, "y": down + 1})
    chosen = page.locator(".spot-on")
    expect(chosen).to_contain_text(place["place"])
    chosen.get_by_role("button").click()
    expect(chosen).to_have_count(0)
    length = page.locator(".map-scale").inner_text()
    for _ in range(4):
        page.get_by_role("button", name="Nearer").click()
    expect(page.locator(".map-scale")).not_to_have_text(length)
    page.get_by_role("button", name="Whole map").click()
    expect(page.locator(".map-scale")).to_have_text(length)


def test_all_places_of_a_pattern_are_counted_before_they_are_started(
    page_at: Callable[..., Page], network: str
) -> None:
    page = page_at(f"maps/{network}")
    card = page.get_by_role("region", name="Junction", exact=True)
    card.get_by_role("link", name="Start a campaign at all 4").click()
    expect(page.get_by_text("4 places × 2 methods × 1 seed")).to_be_visible()
    expect(page.get_by_role("status").filter(has_text="The service would take it")).to_be_visible()


def test_a_map_that_is_refused_says_why(page_at: Callable[..., Page], tmp_path: Path) -> None:
    page = page_at("maps", allowed=("422",))
    page.get_by_role("button", name="Upload").click()
    expect(page.get_by_role("alert")).to_have_text("Choose a file first.")
    bad = tmp_path / "left.net.xml"
    bad.write_text('<net version="1.20"><edge id="a" from="b" to="c"></edge></net>')
    upload(page, bad)
    expect(page.get_by_role("alert")).to_contain_text("edge 'a'")


def test_the_same_map_twice_is_recognised(page_at: Callable[..., Page], service: Service, network: str) -> None:
    page = page_at("maps")
    before = len(service.client.get("/v1/networks").json()["items"])
    upload(page, NET, "the same again")
    expect(page.get_by_role("status").first).to_contain_text("This map was uploaded before")
    expect(page).to_have_url(re.compile(f"#/maps/{network}"))
    assert len(service.client.get("/v1/networks").json()["items"]) == before


def test_a_map_is_deleted_after_a_question(page_at: Callable[..., Page], service: Service, town: Path) -> None:
    page = page_at("maps")
    upload(page, town, "to be deleted")
    expect(page.get_by_role("heading", level=1)).to_have_text("to be deleted")
    page.get_by_role("link", name="Maps").first.click()
    page.get_by_role("button", name="Delete to be deleted").click()
    page.get_by_role("button", name="Delete for good").click()
    expect(page.get_by_role("link", name="to be deleted")).to_have_count(0)
    labels = [each["label"] for each in service.client.get("/v1/networks").json()["items"]]
    assert "to be deleted" not in labels
