"""The report of a campaign, as a browser shows and prints it."""

from collections.abc import Callable

from playwright.sync_api import Page, expect

from tests.server import Service
from tests.web.conftest import CAMPAIGN, PHONE

BANNER = "Search results are no crash rate."


def address(service: Service, campaign: str) -> str:
    return f"{service.client.base_url}/v1/campaigns/{campaign}/report?format=html"


def test_the_page_leads_to_it(page_at: Callable[..., Page], campaign: str) -> None:
    page = page_at(f"campaigns/{campaign}")
    with page.expect_popup() as opened:
        page.get_by_role("link", name="Report").click()
    expect(opened.value.get_by_role("note")).to_contain_text(BANNER)


def test_it_is_read_looked_at_and_printed(
    new_page: Callable[..., Page], check_axe: Callable[[Page], None], service: Service, campaign: str
) -> None:
    page = new_page()
    page.goto(address(service, campaign))
    expect(page.get_by_role("heading", level=1)).to_have_text(f"Failures of an ego: {CAMPAIGN['label']}")
    pictures = page.get_by_role("img").all()
    assert len(pictures) >= 2
    for picture in pictures:
        assert picture.evaluate("image => image.complete && image.naturalWidth") == 240
    for link in page.get_by_role("navigation").get_by_role("link").all():
        assert page.locator(link.get_attribute("href") or "").count() == 1
    check_axe(page)
    page.emulate_media(color_scheme="dark")
    check_axe(page)
    printed = page.pdf(format="A4")
    assert printed.startswith(b"%PDF")
    page.emulate_media(media="print", color_scheme="dark")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    page.set_viewport_size({"width": 680, "height": 960})  # about A4 without its margins
    assert page.evaluate("document.documentElement.scrollWidth") <= 680


def test_it_needs_no_script_and_fits_a_phone(new_page: Callable[..., Page], service: Service, campaign: str) -> None:
    page = new_page(PHONE, java_script_enabled=False)
    page.goto(address(service, campaign))
    expect(page.get_by_role("note")).to_contain_text(BANNER)
    expect(page.get_by_role("heading", name="Coverage")).to_be_visible()
    box = page.locator("main").bounding_box()
    assert box is not None
    assert box["x"] + box["width"] <= PHONE["width"]
    for block in page.locator("main > *").all():
        around = block.bounding_box()
        assert around is None or around["x"] + around["width"] <= PHONE["width"]
