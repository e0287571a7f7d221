"""Every screen keeps the rules of accessibility, in both themes, and needs no sideways scrolling on a phone."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page

from tests.server import Service
from tests.web.conftest import PHONE


def heading(page: Page) -> None:
    page.get_by_role("heading", level=1).first.wait_for()


def curves(page: Page) -> None:
    page.get_by_role("group", name="Sliding ECR over episodes").or_(page.locator(".u-over").first).first.wait_for()


def triage(page: Page) -> None:
    page.get_by_text("Ranges by numbers").click()
    page.locator(".cards li").first.get_by_role("button", name="Triage").click()
    page.get_by_role("dialog").get_by_label("Comment").wait_for()


def plots(page: Page) -> None:
    page.locator("canvas.stage[data-time]").first.wait_for()
    page.locator(".time-plot .u-over").first.wait_for()


def form(page: Page) -> None:
    for title in ("Ego", "Operational design domain", "Requirements", "Learner", "Agent"):
        group = page.locator(f"details.group:has(> summary > .group-title:text-is('{title}'))")
        group.locator("summary").first.click()
    page.get_by_role("button", name="Add a requirement").click()
    page.get_by_label("Formula").fill("ttc_s >== 3 and " + "ttc_s > 1 and " * 20 + "ttc_s > 1")
    page.locator(".fault pre").wait_for()


def question(page: Page) -> None:
    page.get_by_label("Select all").check()
    page.get_by_role("button", name="Delete night").click()
    page.get_by_role("dialog").wait_for()


def places(page: Page) -> None:
    page.get_by_alt_text("The map from above").wait_for()
    page.get_by_text("Why elsewhere not").click()


SCREENS: dict[str, tuple[str, Callable[[Page], None]]] = {
    "campaigns": ("campaigns", heading),
    "question": ("campaigns", question),
    "nowhere": ("nowhere", heading),
    "new": ("new", form),
    "campaign": ("campaigns/{campaign}", curves),
    "failures": ("campaigns/{campaign}/failures?every=1&family=mixed&brush=closing:1:", triage),
    "refused": ("campaigns/{campaign}/failures?tab=refused", heading),
    "replay": ("campaigns/{campaign}/failures/{failure}", plots),
    "twin": ("campaigns/{campaign}/failures/{failure}/twin/idle", plots),
    "report": ("campaigns/{campaign}/compare", heading),
    "compare": ("compare?ids={campaign}", heading),
    "maps": ("maps", heading),
    "map": ("maps/{network}", places),
}


@pytest.mark.parametrize("screen", SCREENS)
def test_a_screen_is_accessible_and_fits_a_phone(
    screen: str,
    page_at: Callable[..., Page],
    service: Service,
    campaign: str,
    network: str,
    check_axe: Callable[[Page], None],
) -> None:
    place, prepare = SCREENS[screen]
    failure = service.get(campaign, "/failures", limit=1)["items"][0]["id"]
    address = place.format(campaign=campaign, failure=failure, network=network)
    page = page_at(address, allowed=("422",))
    prepare(page)
    page.wait_for_load_state("networkidle")
    for scheme in ("dark", "light"):
        page.emulate_media(color_scheme=scheme)
        check_axe(page)
    page.set_viewport_size(PHONE)
    page.wait_for_function("width => document.documentElement.scrollWidth <= width", arg=PHONE["width"])
