"""Scenarios on the page: found, read, written, and searched by a campaign."""

import re
from collections.abc import Callable

from playwright.sync_api import Page, expect

from tests.server import Service

DOCUMENT = "Document, as YAML or JSON"


def test_a_search_finds_scenarios_by_name_summary_and_tag(page_at: Callable[..., Page], service: Service) -> None:
    items = service.client.get("/v1/scenarios").json()["items"]
    page = page_at("scenarios")
    cards = page.locator(".scenario-cards > li")
    expect(cards).to_have_count(len(items))
    page.get_by_label("Search").fill("dense")
    card = page.locator(".scenario-cards > li", has=page.get_by_role("link", name="Dense", exact=True))
    expect(card.locator("img")).to_be_visible()
    expect(page).to_have_url(re.compile(r"\?search=dense$"))
    page.get_by_label("Search").fill("no such scenario")
    expect(page.get_by_text("No scenario matches.")).to_be_visible()
    assert len(items) >= 3


def test_a_scenario_leads_to_its_campaigns_and_to_a_new_one(
    page_at: Callable[..., Page], service: Service, campaign: str
) -> None:
    assert campaign  # there is one at least
    shown = service.client.get("/v1/scenarios/low").json()
    page = page_at("scenarios/low")
    expect(page.get_by_role("region", name="Document").locator("pre")).to_have_text(shown["document"])
    rows = page.get_by_role("region", name="Table of parameters").locator("tbody tr")
    expect(rows).to_have_count(len(shown["parameters"]))
    campaigns = page.get_by_role("region", name="Campaigns").get_by_role("link")
    newest = service.client.get("/v1/campaigns", params={"family": "low"}).json()["items"][0]["id"]
    expect(campaigns.first).to_have_attribute("href", f"#/campaigns/{newest}")
    expect(page.get_by_alt_text("The scenario from above with the ranges of all starts")).to_be_visible()
    page.get_by_role("link", name="Start a campaign").click()
    expect(page.get_by_role("checkbox", name="low", exact=True)).to_be_checked()
    expect(page.get_by_role("checkbox", name="mixed", exact=True)).not_to_be_checked()


def test_a_document_is_checked_saved_chosen_and_deleted(page_at: Callable[..., Page], service: Service) -> None:
    page = page_at("scenarios/new?from=low", allowed=("422",))
    document = page.get_by_label(DOCUMENT)
    text = service.client.get("/v1/scenarios/low").json()["document"]
    expect(document).to_have_value(text)
    document.fill(text.replace("name: low", "name: mine") + "\nnonsense: 1\n")
    expect(page.get_by_role("alert").locator("code")).to_have_text(["nonsense"])
    document.fill(text.replace("name: low", "name: mine"))
    expect(page.get_by_text("The service would take it.")).to_be_visible()
    page.get_by_role("button", name="Save the scenario").click()
    expect(page).to_have_url(re.compile("#/scenarios/mine_[0-9a-f]{12}$"))
    name = page.url.rsplit("/", 1)[1]
    assert service.client.get(f"/v1/scenarios/{name}").json()["shipped"] is False
    page.get_by_role("link", name="Start a campaign").click()
    expect(page.get_by_role("checkbox", name=name, exact=True)).to_be_checked()
    expect(page.get_by_role("status").filter(has_text="The service would take it")).to_be_visible()
    page.go_back()
    expect(page.get_by_role("button", name="Delete", exact=True)).to_be_visible()
    expect(page.get_by_alt_text("The scenario from above")).to_be_visible()  # else its picture is gone, a 404
    page.get_by_role("button", name="Delete", exact=True).click()
    page.get_by_role("button", name="Delete for good").click()
    expect(page).to_have_url(re.compile("#/scenarios$"))
    assert service.client.get(f"/v1/scenarios/{name}").status_code == 404
