"""An ego over its versions: table, charts, and markers between unlike ones."""

import json
from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
from playwright.sync_api import Page, Route, expect

from risk_sac.records import RequirementCounts, wire
from risk_sac.report.trend import EndedCampaign, LeftOut, trend
from tests.builders import run_metrics
from tests.server import Service
from tests.versions import SOFTWARE, ended_campaign
from tests.web.conftest import PHONE

CUT_IN, LEADER, WALKER = "cut-in, straight", "leader, straight", "pedestrian, right turn, hidden by a parked van"
NEWER = SOFTWARE | {"definitions": "11"}


def drawn(failures: int) -> Any:
    counts = {
        "no_contact": RequirementCounts(counts="failure", violated=failures, valid=failures, distinct=1),
        "safe_ttc": RequirementCounts(counts="report", violated=3 * failures),
    }
    return run_metrics(300, failures=failures, requirements=counts)


def version(name: str, kinds: list[str], failures: int, **changes: Any) -> EndedCampaign:
    fresh = drawn(failures)
    return ended_campaign(name, kinds, drawn=fresh, requirements=fresh.requirements, **changes)


CAMPAIGNS = (
    version("1.3", [CUT_IN, LEADER], 12),
    version("1.4", [LEADER, WALKER], 9, ego={"driver": "idm-aeb", "defects": ["late-action"]}),
    version("1.5", [CUT_IN], 4),
    version("2.0-rc1", [CUT_IN, WALKER], 6, versions=NEWER),
    version("2.0", [], 1, versions=NEWER),
    version("2.1", [LEADER], 2, versions=NEWER, methods=("random",)),
)


@pytest.fixture
def page(page_at: Callable[..., Page], new_page: Callable[..., Page], service: Service) -> Callable[..., Page]:
    """Opens the screen with what the service would answer of these campaigns."""

    def answer(route: Route) -> None:
        chosen = parse_qs(urlsplit(route.request.url).query).get("campaign", [])
        asked = [campaign for campaign in CAMPAIGNS if not chosen or campaign.id in chosen]
        left_out = [] if chosen else [LeftOut(campaign_id="c9", reason="it is running")]
        route.fulfill(body=wire(trend(asked, left_out)), content_type="application/json")

    def open_at(query: str = "", **options: Any) -> Page:
        page = new_page(**options)
        page.route("**/v1/egos/idm-aeb/trend*", answer)
        page.goto(f"{service.client.base_url}/page/#/trend?ego=idm-aeb{query}")
        return page

    return open_at


def said(page: Page, title: str) -> str:
    """What a chart says to a screen reader."""
    chart = page.get_by_role("img", name=title, exact=True)
    expect(chart).to_be_visible()
    return str(page.locator(f"[id='{chart.get_attribute('aria-describedby')}']").inner_text())


def test_each_figure_has_a_chart_over_the_versions(page: Callable[..., Page]) -> None:
    shown = page()
    assert said(shown, "Headline kinds").split(". ") == [
        "1.3: 2",
        "1.4 (defects late-action): 2",
        "1.5: 1",
        "2.0-rc1: 2, not comparable with the version before: definitions 10 → 11",
        "2.0: 0",
    ]
    assert said(shown, "Failure rate").startswith("1.3: 4.0 %, between 2.3 % and 6.9 %. ")
    assert said(shown, "no contact").startswith("1.3: 4.0 %")
    assert said(shown, "safe ttc").startswith("1.3: 12.0 %")


def test_no_line_leads_over_a_change_of_the_definitions(page: Callable[..., Page]) -> None:
    shown = page()
    chart = shown.get_by_role("img", name="Headline kinds", exact=True)
    expect(chart.locator(".spot")).to_have_count(5)
    expect(chart.locator(".joined-spots")).to_have_count(3)
    expect(chart.locator(".break")).to_have_attribute("data-change", "definitions 10 → 11")
    expect(shown.locator("tr[data-changed]")).to_have_attribute("data-version", "2.0-rc1")


def test_kinds_are_new_gone_and_returned(page: Callable[..., Page]) -> None:
    rows = page().get_by_role("region", name="Kinds and versions").locator("tbody tr")
    expect(rows).to_have_count(3)
    changes = {
        row.locator("th").inner_text(): [cell.get_attribute("data-change") for cell in row.locator("td").all()]
        for row in rows.all()
    }
    assert changes == {
        CUT_IN: ["found", "gone", "returned", "found", "gone"],
        LEADER: ["found", "found", "gone", "absent", "absent"],
        WALKER: ["absent", "new", "gone", "found", "gone"],
    }


def test_versions_are_chosen_in_the_table_and_compared_by_the_service(page: Callable[..., Page]) -> None:
    shown = page()
    shown.get_by_label("1.4 (defects late-action)").uncheck()
    expect(shown.get_by_role("img", name="Headline kinds", exact=True).locator(".spot")).to_have_count(4)
    assert said(shown, "Headline kinds").startswith("1.3: 2. 1.5: 1. ")
    assert "campaigns=c1.3%2Cc1.5%2Cc2.0-rc1%2Cc2.0" in shown.url
    shown.get_by_label("1.4 (defects late-action)").check()
    expect(shown.get_by_role("img", name="Headline kinds", exact=True).locator(".spot")).to_have_count(5)


def test_other_terms_have_a_row_of_their_own(page: Callable[..., Page]) -> None:
    shown = page()
    rows = shown.get_by_role("region", name="Terms of the campaigns").locator("tbody tr")
    expect(rows).to_have_count(2)
    expect(rows.nth(1)).to_contain_text("methods")
    rows.nth(1).get_by_role("link").click()
    expect(shown.get_by_role("region", name="Versions, oldest first").locator("tbody tr")).to_have_count(1)
    expect(shown.get_by_text("1 campaign is left out")).to_be_visible()


def test_a_refusal_is_told_in_one_line(new_page: Callable[..., Page], service: Service) -> None:
    shown, detail = new_page(allowed=("422",)), "wanted campaigns of the same scenarios"
    problem = {"status": 422, "title": "x", "detail": detail, "reason": "invalid_field"}
    refused = {"status": 422, "content_type": "application/problem+json", "body": json.dumps(problem)}
    shown.route("**/v1/egos/default/trend*", lambda route: route.fulfill(**refused))
    shown.goto(f"{service.client.base_url}/page/#/trend?ego=default&campaigns=c1,c2")
    expect(shown.get_by_role("alert")).to_contain_text(detail)


def test_the_charts_are_accessible_and_fit(page: Callable[..., Page], check_fits: Callable[[Page], None]) -> None:
    shown = page(viewport=PHONE)
    expect(shown.get_by_role("img", name="Headline kinds", exact=True)).to_be_visible()
    check_fits(shown)
