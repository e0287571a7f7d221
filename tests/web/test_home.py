"""Start page: egos with their newest results, or the first steps."""

from collections.abc import Callable

from playwright.sync_api import Page, expect

from risk_sac.records import wire
from risk_sac.report.trend import trend
from tests.server import Service
from tests.web.test_trend import CAMPAIGNS, CUT_IN


def test_an_ego_stands_with_its_newest_campaign_and_what_runs(
    page_at: Callable[..., Page], service: Service, campaign: str
) -> None:
    running = service.post(label="at work", families=["low"], methods=["random"], budget={"episodes": 50_000})
    try:
        page = page_at()
        ego = page.locator("[data-ego=default]")
        expect(ego.get_by_role("region", name="Running").get_by_role("link")).to_have_text("at work")
        expect(
            page.get_by_role("link", name="1 running").or_(page.get_by_role("link", name="1 queued"))
        ).to_be_visible()
    finally:
        service.client.post(f"/v1/campaigns/{running}/cancel")
        service.wait(running)
        service.client.delete(f"/v1/campaigns/{running}")
    expect(ego.get_by_role("region", name="Running")).to_have_count(0)
    listed = service.client.get("/v1/campaigns", params={"limit": 50}).json()["items"]
    newest = next(each for each in listed if each["ego"]["driver"] is None and each["ego"]["profile"] == "default")
    expect(ego.locator(".newest-campaign")).to_contain_text(newest["label"])
    expect(ego.locator(".scenario-names")).to_have_text(", ".join(newest["families"]))
    failures = service.get(newest["id"])["progress"]["failures"]
    expect(ego.locator(".newest-campaign")).to_contain_text(f"{failures} valid failures")


def test_headline_kinds_and_versions_are_those_of_the_trend(page_at: Callable[..., Page], campaign: str) -> None:
    told = wire(trend(CAMPAIGNS[:3]))
    page = page_at("nowhere")
    page.route("**/egos/default/trend", lambda route: route.fulfill(body=told, content_type="application/json"))
    page.get_by_role("link", name="Egos", exact=True).click()
    ego = page.locator("[data-ego=default]")
    expect(ego.locator(".ego-versions li")).to_have_text(["1.32", "1.42", "1.51"])
    expect(ego.locator(".headline-kinds li")).to_have_text([f"{CUT_IN} returned"])
    expect(ego).to_contain_text("2 of the version before not found again.")


def test_a_newcomer_sees_three_steps_with_a_picture(page_at: Callable[..., Page]) -> None:
    page = page_at("nowhere")
    page.route(
        "**/v1/campaigns?**",
        lambda route: route.fulfill(body='{"items":[],"next":null}', content_type="application/json"),
    )
    page.get_by_role("link", name="Egos", exact=True).click()
    expect(page.locator(".first li")).to_have_count(3)
    page.wait_for_function("() => document.querySelector('.first img').naturalWidth > 0")
    page.get_by_role("link", name="Start the first campaign").click()
    expect(page.get_by_role("heading", name="New campaign")).to_be_visible()
