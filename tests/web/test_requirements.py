"""Failures without contact on every screen, by a campaign's own requirement."""

import json
import re
from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.server import Service

OWN = {"name": "never_fast", "formula": "ego_speed_mps <= 5", "scale": 5.0}
COUNTED = {"name": "bounded_braking", "counts": "failure"}


@pytest.fixture(scope="module")
def fast(service: Service) -> str:
    """The campaign, ended."""
    spec = {"label": "own", "methods": ["archive"], "seeds": [11], "budget": {"episodes": 12}}
    posted = service.post(**spec, requirements=[OWN, COUNTED])
    assert service.wait(posted)["state"] == "succeeded"
    return posted


@pytest.fixture(scope="module")
def valid(service: Service, fast: str) -> int:
    """Counts valid violations; those inherited and ended within 5 s are none."""
    counted = int(service.get(fast)["requirements"]["never_fast"]["valid"])
    assert 9 <= counted <= 12
    return counted


@pytest.fixture
def failure(service: Service, fast: str, valid: int) -> dict[str, Any]:
    """The first of its failures without contact."""
    listed = service.get(fast, "/failures", requirement="never_fast", limit=50)["items"]
    assert len(listed) == valid
    return next(each for each in listed if each["collision"] is None)


def test_a_campaign_tells_the_funnel_of_each_requirement(
    page_at: Callable[..., Page], service: Service, fast: str, check_axe: Callable[[Page], None]
) -> None:
    page = page_at(f"campaigns/{fast}")
    told = service.get(fast)["requirements"]
    assert (told["never_fast"]["violated"], told["safe_ttc"]["counts"]) == (12, "report")
    for name, funnel in told.items():
        row = page.locator(f"table.requirements tr[data-requirement='{name}']")
        counts = dict.fromkeys(("violated", "valid", "distinct", "preventable", "published"), "–") | {
            step: str(funnel[step])
            for step in ("violated", "valid", "distinct", "preventable", "published")
            if funnel["counts"] == "failure" or step == "violated"
        }
        for step, text in counts.items():
            expect(row.locator(f"[data-step='{step}']")).to_have_text(text)
        expect(row).to_contain_text(f"{100 * funnel['rate']:.1f} %")
    check_axe(page)
    page.get_by_role("link", name="never fast").click()
    expect(page).to_have_url(re.compile("failures[?]requirement=never_fast$"))
    expect(page.get_by_label("Requirement")).to_have_value("never_fast")


def test_failures_are_filtered_by_requirement(page_at: Callable[..., Page], fast: str, valid: int) -> None:
    page = page_at(f"campaigns/{fast}/failures?by=episode")
    expect(page.locator(".found-head p b")).to_have_text(str(valid))
    card = page.locator(".cards li").first
    expect(card).to_contain_text("violated")
    expect(card).to_contain_text("after release")
    expect(card.locator("img.thumbnail")).to_have_count(1)
    page.get_by_role("button", name="More filters").click()
    page.get_by_label("Requirement").select_option("never_fast")
    expect(page.locator(".found-head p b")).to_have_text(str(valid))
    expect(page.get_by_label("Requirement").locator("option")).not_to_have_count(0)


def test_a_violation_without_contact_is_played_with_its_moment_and_its_robustness(
    page_at: Callable[..., Page], fast: str, failure: dict[str, Any], check_axe: Callable[[Page], None]
) -> None:
    page = page_at(f"campaigns/{fast}/failures/{failure['id']}?t=0")
    (violation, *_) = failure["violations"]
    page.locator("canvas.stage[data-time='0.000']").wait_for()
    verdict = page.get_by_role("region", name="Verdict")
    expect(verdict).to_contain_text(f"The ego violated never fast {violation['time_s']:.1f} s after the release")
    expect(page.get_by_role("button", name="Violation")).to_be_visible()
    expect(page.get_by_role("button", name="Contact")).to_have_count(0)
    expect(page.get_by_role("heading", name="Actors at the violation")).to_be_visible()
    plot = page.locator("figure", has_text="never fast, violated below 0").first
    expect(plot.locator(".time-value")).to_contain_text("−")
    check_axe(page)


def test_the_form_says_what_shipped_requirements_count_as(page_at: Callable[..., Page]) -> None:
    page = page_at("new")
    page.get_by_text("More settings").click()
    page.locator("details.group:has(> summary > .group-title:text-is('Requirements')) > summary").click()
    expect(page.get_by_label("no contact")).to_be_disabled()
    expect(page.get_by_label("safe ttc")).to_have_value("report")
    page.get_by_label("safe ttc").select_option("failure")
    page.get_by_label("on carriageway").select_option("report")
    expect(page.get_by_role("status").filter(has_text="The service would take it")).to_be_visible()
    shown = page.get_by_role("region", name="The campaign as curl").inner_text()
    assert json.loads(shown[shown.index("'{") + 1 : shown.rindex("}'") + 1])["requirements"] == [
        {"name": "safe_ttc"},
        {"name": "on_carriageway", "counts": "report"},
    ]
    page.get_by_label("safe ttc").select_option("report")
    page.get_by_label("on carriageway").select_option("failure")
    expect(page.get_by_role("region", name="The campaign as curl")).not_to_contain_text("requirements")
