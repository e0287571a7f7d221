"""Verdicts on a story-sweep's scenes, on the screen of its campaign."""

import re
from collections.abc import Callable

from playwright.sync_api import Page, expect

from tests.server import Service


def test_verdicts_on_scenes_are_a_table_and_a_picture(
    page_at: Callable[..., Page], service: Service, check_axe: Callable[[Page], None]
) -> None:
    campaign = service.post(families=["motorway_cut_in"], methods=["story-sweep"], seeds=[0], budget={"episodes": 6})
    assert service.wait(campaign)["state"] == "succeeded"
    grid = service.get(campaign, "/runs/motorway_cut_in-story-sweep-0/grid")
    page = page_at(f"campaigns/{campaign}")
    section = page.get_by_role("region", name="Verdicts on scenes")
    rows = section.locator("tr[data-scene]")
    expect(rows).to_have_count(6)
    shown = {row.get_attribute("data-scene"): row.locator("th").inner_text() for row in rows.all()}
    assert shown == {point["id"]: point["verdict"].replace("_", " ").capitalize() for point in grid["points"]}
    picture = section.get_by_role("img", name=re.compile("^Verdicts over"))
    expect(picture).to_be_visible()
    first = picture.get_attribute("alt")
    section.get_by_label("Across").select_option(index=2)
    expect(section.get_by_role("img", name=re.compile("^Verdicts over"))).not_to_have_attribute("alt", first or "")
    check_axe(page)


def test_a_campaign_without_stories_has_no_verdicts_on_scenes(page_at: Callable[..., Page], campaign: str) -> None:
    page = page_at(f"campaigns/{campaign}")
    expect(page.get_by_role("heading", name="Scene parameters")).to_be_visible()
    expect(page.get_by_role("heading", name="Verdicts on scenes")).to_have_count(0)
