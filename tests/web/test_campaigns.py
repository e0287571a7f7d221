"""List of campaigns: content, filters, sorting, and actions."""

import json
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, Route, expect

from tests.server import Service
from tests.web.conftest import CAMPAIGN, count

HOSTILE = "<img src=x onerror=alert(1)> ‮& \"'"


@pytest.fixture(scope="module")
def small(service: Service, campaign: str) -> Iterator[dict[str, str]]:
    """Two more ended campaigns by their labels, one of them hostile."""
    posted = {
        label: service.post(label=label, families=["low"], methods=["random"], seeds=[5], budget={"episodes": 1})
        for label in (HOSTILE, "one more")
    }
    for each in posted.values():
        service.wait(each)
    yield posted
    for each in posted.values():
        service.client.delete(f"/v1/campaigns/{each}")


def row(page: Page, campaign_id: str) -> Locator:
    return page.get_by_role("row").filter(has=page.locator(f"a[href='#/campaigns/{campaign_id}']"))


def rows(page: Page) -> Locator:
    return page.locator("tbody tr")


def shown_ids(page: Page) -> list[str]:
    links = page.locator("td.campaign-name > a")
    return [str(link.get_attribute("href")).rsplit("/", 1)[1] for link in links.all()]


def test_a_row_says_what_the_api_says(
    page_at: Callable[..., Page], service: Service, campaign: str, small: dict[str, str]
) -> None:
    page = page_at("campaigns")
    expect(rows(page)).to_have_count(3)
    listed = {item["id"]: item for item in service.client.get("/v1/campaigns").json()["items"]}
    said, cells = listed[campaign], row(page, campaign).locator("td")
    expect(cells.nth(1)).to_contain_text(CAMPAIGN["label"])  # as text: its <b> is no element
    assert row(page, campaign).locator("b").count() == 0
    expect(cells.nth(2)).to_have_text("succeeded")
    expect(cells.nth(3)).to_have_text("low, mixed")
    expect(cells.nth(4)).to_have_text("archive")
    expect(cells.nth(5)).to_have_text("default, Krauss")
    expect(cells.nth(6)).to_have_text(str(said["progress"]["episodes_total"]))
    expect(cells.nth(7)).to_contain_text(f"{100 * said['progress']['window_ecr']:.1f} %")
    found = said["progress"]
    expect(cells.nth(8)).to_have_text(
        count(None) if found["headline"] is None else f"{found['headline']} ({found['headline_published']})"
    )
    expect(cells.nth(9)).to_have_text(count(found["distinct_failures"]))
    expect(cells.nth(10)).to_have_text(f"{found['distinct_preventable']} ({found['distinct_published']})")
    expect(cells.nth(11)).to_contain_text("took")


def test_a_hostile_label_is_text_wherever_it_stands(page_at: Callable[..., Page], small: dict[str, str]) -> None:
    page = page_at("campaigns")
    hostile = row(page, small[HOSTILE])
    expect(hostile.get_by_role("link").first).to_have_text(HOSTILE)
    hostile.get_by_role("button", name="Delete").click()
    expect(page.get_by_role("dialog")).to_contain_text(HOSTILE)
    page.get_by_role("button", name="Keep it").click()
    assert page.locator("img[src=x]").count() == 0


def test_filters_are_the_apis_and_stay_in_the_address(
    page_at: Callable[..., Page], campaign: str, small: dict[str, str]
) -> None:
    page = page_at("campaigns")
    page.get_by_label("Method").select_option("archive")
    expect(rows(page)).to_have_count(1)
    page.get_by_label("Family").select_option("mixed")
    page.get_by_label("State").select_option("succeeded")
    expect(page).to_have_url(re.compile(r"#/campaigns\?state=succeeded&family=mixed&method=archive$|method=archive.*"))
    page.reload()
    expect(page.get_by_label("Family")).to_have_value("mixed")
    expect(rows(page)).to_have_count(1)
    assert shown_ids(page) == [campaign]
    page.get_by_label("State").select_option("failed")
    expect(page.get_by_text("No campaign matches.")).to_be_visible()
    page.get_by_role("button", name="All campaigns").click()
    expect(rows(page)).to_have_count(3)
    page.get_by_role("searchbox", name="Search").fill(HOSTILE)
    expect(rows(page)).to_have_count(1)
    assert shown_ids(page) == [small[HOSTILE]]


def test_a_tag_is_added_to_a_campaign_and_a_click_on_it_filters_the_list(
    page_at: Callable[..., Page], service: Service, small: dict[str, str]
) -> None:
    page = page_at(f"campaigns/{small['one more']}", allowed=("422",))
    page.get_by_role("button", name="Add tags").click()
    field = page.get_by_role("textbox", name="Tags")
    field.fill("Nightly, wrong!")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("alert")).to_contain_text("tags[1]")
    field.fill("Nightly, release:2.1")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("button", name="Change tags")).to_be_visible()
    assert service.get(small["one more"])["tags"] == ["nightly", "release:2.1"]
    page.goto(f"{service.client.base_url}/page/#/campaigns?state=succeeded")
    row(page, small["one more"]).get_by_role("link", name="nightly").click()
    expect(page).to_have_url(re.compile(r"state=succeeded&tag=nightly$"))
    expect(rows(page)).to_have_count(1)
    assert shown_ids(page) == [small["one more"]]


def test_words_of_a_label_or_an_id_find_a_campaign_while_they_are_typed(
    page_at: Callable[..., Page], campaign: str, small: dict[str, str]
) -> None:
    page = page_at("campaigns")
    expect(rows(page)).to_have_count(3)
    for text, found in (("MORE one", small["one more"]), ("b>7", campaign), (campaign[3:12], campaign)):
        page.get_by_role("searchbox", name="Search").fill(text)
        expect(page.locator("td.campaign-name > a")).to_have_count(1)
        expect(page.locator("td.campaign-name > a")).to_have_attribute("href", f"#/campaigns/{found}")
    page.get_by_role("searchbox", name="Search").fill("100% more")  # no wildcard
    expect(page.get_by_text("No campaign matches.")).to_be_visible()
    page.reload()
    expect(page.get_by_role("searchbox", name="Search")).to_have_value("100% more")


def test_a_click_on_a_head_sorts_and_a_second_one_turns_it_around(
    page_at: Callable[..., Page], service: Service, campaign: str, small: dict[str, str]
) -> None:
    page = page_at("campaigns")
    expect(rows(page)).to_have_count(3)
    newest_first = [item["id"] for item in service.client.get("/v1/campaigns").json()["items"]]
    assert shown_ids(page) == newest_first
    page.get_by_role("button", name="Episodes").click()
    head = page.get_by_role("columnheader", name="Distinct")
    head.get_by_role("button").click()
    expect(head).to_have_attribute("aria-sort", "descending")
    assert shown_ids(page)[0] == campaign
    head.get_by_role("button").press("Enter")
    expect(head).to_have_attribute("aria-sort", "ascending")
    expect(page).to_have_url(re.compile(r"sort=distinct$"))
    assert shown_ids(page)[-1] == campaign


def test_older_ones_come_page_by_page(page_at: Callable[..., Page], campaign: str, small: dict[str, str]) -> None:
    page = page_at("nowhere")
    page.route(
        "**/v1/campaigns?**", lambda route: route.continue_(url=re.sub(r"limit=\d+", "limit=1", route.request.url))
    )
    page.get_by_role("link", name="Campaigns", exact=True).click()
    expect(rows(page)).to_have_count(1)
    for number in (2, 3):
        page.get_by_role("button", name="Show more").click()
        expect(rows(page)).to_have_count(number)
    expect(page.get_by_role("button", name="Show more")).to_have_count(0)
    assert len(set(shown_ids(page))) == 3


def test_a_search_is_cancelled_only_after_a_question(page_at: Callable[..., Page], service: Service) -> None:
    posted = service.post(label="long", families=["low"], methods=["random"], budget={"episodes": 50_000})
    page = page_at("campaigns")
    page.get_by_role("button", name="Cancel long").click()
    expect(page.get_by_role("dialog")).to_be_visible()  # a key pressed before it is there closes nothing
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_have_count(0)
    assert service.get(posted)["state"] in ("queued", "running")
    page.get_by_role("button", name="Cancel long").click()
    page.get_by_role("button", name="Cancel the search").click()
    expect(page.get_by_role("dialog")).to_have_count(0)
    expect(row(page, posted).locator(".tag")).to_have_text("cancelled")  # the list asks until it is
    assert service.get(posted)["state"] == "cancelled"
    page.get_by_role("button", name="Delete long").click()
    page.get_by_role("button", name="Keep it").click()
    assert service.client.get(f"/v1/campaigns/{posted}").status_code == 200
    page.get_by_role("button", name="Delete long").click()
    page.get_by_role("button", name="Delete for good").click()
    expect(row(page, posted)).to_have_count(0)
    assert service.client.get(f"/v1/campaigns/{posted}").status_code == 404


def test_a_refusal_is_told_where_it_was_asked_for(
    page_at: Callable[..., Page], service: Service, small: dict[str, str]
) -> None:
    gone = service.post(label="gone", families=["low"], methods=["random"], budget={"episodes": 1})
    service.wait(gone)
    page = page_at("campaigns", allowed=("404",))
    page.get_by_role("button", name="Delete gone").click()
    assert service.client.delete(f"/v1/campaigns/{gone}").status_code == 204
    page.get_by_role("button", name="Delete for good").click()
    expect(page.get_by_role("dialog").get_by_role("alert")).to_contain_text(gone)
    expect(row(page, gone)).to_have_count(0)  # the list was asked again all the same


def test_the_list_is_asked_again_while_one_is_at_work_and_not_while_nobody_looks(
    new_page: Callable[..., Page], service: Service, campaign: str
) -> None:
    page = new_page()
    asked: list[str] = []

    def at_work(route: Route) -> None:
        body: dict[str, Any] = route.fetch().json()
        asked.append(route.request.url)
        done = len(asked)
        for item in body["items"]:
            item["state"] = "running"
            item["progress"] |= {"episodes_done": done, "episodes_total": 100, "eta_s": 90}
        route.fulfill(body=json.dumps(body), content_type="application/json")

    page.route("**/v1/campaigns?**", at_work)
    page.clock.install()
    page.goto(f"{service.client.base_url}/page/#/campaigns")
    bar = row(page, campaign).get_by_role("progressbar")
    expect(bar).to_have_attribute("aria-valuenow", "1")
    expect(row(page, campaign)).to_contain_text("1 min 30 s")
    page.clock.run_for(2500)
    expect(bar).to_have_attribute("aria-valuenow", "2")
    page.evaluate("Object.defineProperty(document, 'hidden', {value: true, configurable: true})")
    page.clock.run_for(60_000)
    assert len(asked) == 2
    page.evaluate("delete document.hidden; document.dispatchEvent(new Event('visibilitychange'))")
    expect(bar).to_have_attribute("aria-valuenow", "3")


def test_the_list_can_be_used_by_keyboard_alone(page_at: Callable[..., Page], campaign: str) -> None:
    page = page_at("campaigns")
    row(page, campaign).get_by_role("checkbox").focus()
    page.keyboard.press("Space")
    expect(page.get_by_role("group", name="With those selected")).to_contain_text("1 selected")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    expect(page).to_have_url(re.compile(f"#/campaigns/{campaign}$"))
