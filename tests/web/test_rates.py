"""Rates of a campaign: estimates with intervals, or why there are none."""

from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from risk_sac.rates.record import with_exposure
from risk_sac.records import wire
from risk_sac.records.rates import DeclaredParameter, RateEstimate, Rates
from service.views.reports import CampaignRates
from tests.server import Service
from tests.web.conftest import PHONE

CHECKS = {"at_most": 0.03, "effective_failures": 88.0, "largest_share": 0.02, "declared_share": 0.1}
KNOWN = RateEstimate(failures=412, rate=0.0178, low=0.015, high=0.0211, why="", **CHECKS)
RARE = RateEstimate(failures=3, rate=None, low=None, high=None, why="3.0 of equal weight; 15 are needed", **CHECKS)
UNIFORM = DeclaredParameter(kind="uniform", source="")
RATES = Rates(
    run_id="mixed-rate-3",
    draws=2000,
    asked=2000,
    played=1987,
    scenes_per_hour=None,
    rates={"failure": KNOWN, "no_contact": RARE},
    distributions={"walk_mps": DeclaredParameter(kind="normal", source="Knoblauch 1996"), "gap_m": UNIFORM},
    correlated=(),
)


@pytest.fixture
def page(new_page: Callable[..., Page], service: Service, campaign: str) -> Callable[..., Page]:
    """Opens a campaign with a run of `rate` and given rates."""

    def answer(route: Route) -> None:
        asked = 12.0 if "exposure=12" in route.request.url else None
        rates = RATES.model_copy(update={"scenes_per_hour": asked, "rates": with_exposure(RATES.rates, asked)})
        route.fulfill(body=wire(CampaignRates(complete=True, items=[rates])), content_type="application/json")

    def with_rate(route: Route) -> None:
        told = service.get(campaign)
        told["runs"][1]["method"] = "rate"
        route.fulfill(json=told)

    def open_it(**options: Any) -> Page:
        page = new_page(**options)
        page.route(f"**/v1/campaigns/{campaign}", with_rate)
        page.route("**/rates*", answer)
        page.goto(f"{service.client.base_url}/page/#/campaigns/{campaign}")
        return page

    return open_it


def test_each_requirement_has_its_rate_or_why_it_has_none(page: Callable[..., Page]) -> None:
    shown = page()
    card = shown.get_by_role("region", name="Failure rates", exact=True)
    expect(card.locator("tr[data-rate='failure'] td")).to_have_text(["412", "0.0178", "0.015 to 0.0211"])
    expect(card.locator("tr[data-rate='no_contact'] td").last).to_have_text(
        "not estimated: 3.0 of equal weight; 15 are needed; at most 0.03 (95 %)"
    )
    expect(card).to_contain_text("1,987 of 2,000 draws played")
    expect(card).to_contain_text("walk_mps normal (Knoblauch 1996); all others uniform, a choice.")


def test_an_exposure_gives_rates_per_hour(page: Callable[..., Page]) -> None:
    card = page().get_by_role("region", name="Failure rates", exact=True)
    card.get_by_label("Scenes of this scenario in an hour").fill("12")
    expect(card.locator("tr[data-rate='failure'] td").last).to_have_text("0.214 (0.18 to 0.253)")


def test_a_campaign_without_the_method_has_no_rates(page_at: Callable[..., Page], campaign: str) -> None:
    shown = page_at(f"campaigns/{campaign}")
    shown.get_by_role("list", name="Funnel").wait_for()
    expect(shown.get_by_role("heading", name="Failure rates")).to_have_count(0)


def test_the_rates_are_accessible_and_fit(page: Callable[..., Page], check_fits: Callable[[Page], None]) -> None:
    shown = page(viewport=PHONE)
    shown.locator("tr[data-rate='failure']").wait_for()
    check_fits(shown)
