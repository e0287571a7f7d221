"""Every screen is accessible in both themes and fits every width."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.server import Service
from tests.web.conftest import COLOURS, PHONE, UNROUNDED, show_in

WIDTHS = (1440, 1024, PHONE["width"])
STATES = ("hover", "focus", "focus-visible", "active")
OUTLINE = 3.0  # contrast that WCAG 1.4.11 wants of what marks the focus


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
    page.get_by_text("More settings").click()
    for title in ("Defects", "Delay and sight", "Operational design domain", "Requirements", "Learner", "Agent"):
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
    page.get_by_role("group", name="The map from above").wait_for()
    page.locator("button.spot").first.click()
    page.get_by_text("Where no pattern fits").click()


def covered(page: Page) -> None:
    page.locator(".chip.cell-failed").first.click()


def cards(page: Page) -> None:
    page.locator(".scenario-cards img").first.wait_for()


def drawing(page: Page) -> None:
    page.get_by_alt_text("The scenario from above with the ranges of all starts").wait_for()


def document(page: Page) -> None:
    text = page.get_by_label("Document, as YAML or JSON")
    expect(text).not_to_have_value("")
    text.press("ControlOrMeta+End")
    text.press_sequentially("\nnonsense: 1\n")
    page.get_by_role("alert").locator("code").first.wait_for()


# What reaches beyond its parent to the right; not what scrolls, floats above the page, or hangs out by its margin.
WIDER_THAN_PARENT = """() => [...document.querySelectorAll("#page *")].flatMap((each) => {
    let parent = each.parentElement;
    while (getComputedStyle(parent).display === "contents") parent = parent.parentElement;
    const style = getComputedStyle(each);
    const around = getComputedStyle(parent);
    const shortened = around.textOverflow === "ellipsis" || around.webkitLineClamp !== "none";
    if (parent.closest("svg, select") || ["absolute", "fixed"].includes(style.position)) return [];
    if (["auto", "scroll"].includes(around.overflowX) || shortened || style.display === "contents") return [];
    const hangs = Math.min(0, parseFloat(style.marginRight));
    const beyond = each.getBoundingClientRect().right + hangs - parent.getBoundingClientRect().right;
    return beyond > 1 ? [`${each.outerHTML.slice(0, 120)} by ${beyond.toFixed(0)} px`] : [];
})"""
# The colour of the ring around what has the focus, and of the grounds that it lies on.
RING = """() => {
    const style = getComputedStyle(document.documentElement);
    return ["--accent", "--ground", "--surface", "--raised"].map((name) => style.getPropertyValue(name).trim());
}"""


def contrast(one: str, other: str) -> float:
    """Returns the contrast of two colours (#0b5a94, #fff) by WCAG 2."""

    def luminance(colour: str) -> float:
        if len(colour) == 4:
            colour = "#" + "".join(2 * digit for digit in colour[1:])
        parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
        red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
        return 0.2126 * red + 0.7152 * green + 0.0722 * blue

    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


SCREENS: dict[str, tuple[str, Callable[[Page], None]]] = {
    "home": ("", heading),
    "campaigns": ("campaigns", heading),
    "question": ("campaigns", question),
    "nowhere": ("nowhere", heading),
    "choices": ("new", heading),
    "new": ("new", form),
    "campaign": ("campaigns/{campaign}", curves),
    "failures": ("campaigns/{campaign}/failures?by=episode&family=mixed&brush=closing:1:", triage),
    "refused": ("campaigns/{campaign}/failures?tab=refused", heading),
    "replay": ("campaigns/{campaign}/failures/{failure}", plots),
    "twin": ("campaigns/{campaign}/failures/{failure}/twin/idle", plots),
    "report": ("campaigns/{campaign}/compare", heading),
    "compare": ("compare?ids={campaign}", heading),
    "workers": ("workers", heading),
    "maps": ("maps", heading),
    "map": ("maps/{network}", places),
    "coverage": ("campaigns/{campaign}/coverage", covered),
    "trend": ("trend?ego=default", heading),
    "scenarios": ("scenarios", cards),
    "scenario": ("scenarios/motorway_traffic", drawing),
    "editor": ("scenarios/new?from=low", document),
}


@pytest.mark.parametrize("screen", SCREENS)
def test_a_screen_is_accessible_and_fits_every_width(
    screen: str,
    page_at: Callable[..., Page],
    service: Service,
    campaign: str,
    network: str,
    check_axe: Callable[..., None],
) -> None:
    place, prepare = SCREENS[screen]
    failure = service.get(campaign, "/failures", limit=1)["items"][0]["id"]
    address = place.format(campaign=campaign, failure=failure, network=network)
    page = page_at(address, allowed=("422",))
    prepare(page)
    page.wait_for_load_state("networkidle")
    show_in(page, "dark")
    check_axe(page)
    show_in(page, "light")
    check_axe(page, rules=COLOURS)
    check_buttons(page, check_axe)
    assert page.evaluate(UNROUNDED) == []
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        page.wait_for_function("width => document.documentElement.scrollWidth <= width", arg=width)
        assert page.evaluate(WIDER_THAN_PARENT) == [], f"at {width} px"


def check_buttons(page: Page, check_axe: Callable[..., None]) -> None:
    """Checks the contrast of every button's text and focus ring."""
    session = page.context.new_cdp_session(page)
    for domain in ("DOM", "CSS"):
        session.send(f"{domain}.enable")
    root = session.send("DOM.getDocument")["root"]["nodeId"]
    buttons = session.send("DOM.querySelectorAll", {"nodeId": root, "selector": "button, .button, nav a"})["nodeIds"]
    for button in buttons:
        session.send("CSS.forcePseudoState", {"nodeId": button, "forcedPseudoClasses": STATES})
    for scheme in ("light", "dark"):
        show_in(page, scheme)
        check_axe(page, rules=["color-contrast"])
        ring, *grounds = page.evaluate(RING)
        assert min(contrast(ring, ground) for ground in grounds) >= OUTLINE
    session.detach()
