"""Around every screen: the page's address, keys, a lost server, themes."""

import gzip
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.server import Service, servers


def test_a_browser_comes_from_the_entrance_to_the_page_and_a_program_does_not(
    service: Service, new_page: Callable[..., Page]
) -> None:
    page = new_page()
    page.goto(str(service.client.base_url))
    expect(page).to_have_url(f"{service.client.base_url}/page/")
    expect(page.get_by_role("navigation", name="Main")).to_be_visible()
    assert service.client.get("/").json()["name"] == "RISK-SAC"


def test_the_page_allows_no_script_but_its_own(service: Service) -> None:
    policy = service.client.get("/page/").headers["content-security-policy"]
    assert "default-src 'none'; script-src 'self'; style-src 'self'" in policy
    assert "unsafe" not in policy


def test_the_assets_are_small_and_kept(service: Service) -> None:
    index = service.client.get("/page/").text
    names = [part.split('"')[0] for part in index.split("./assets/")[1:]]
    assert len(names) >= 2
    sizes = []
    for name in names:
        answer = service.client.get(f"/page/assets/{name}")
        assert "immutable" in answer.headers["cache-control"]
        sizes.append(len(gzip.compress(answer.content)))
    assert sum(sizes) <= 250_000


def test_the_choice_of_a_theme_survives_a_reload(page_at: Callable[..., Page]) -> None:
    page = page_at("nowhere", color_scheme="light")
    page.get_by_role("button", name="Dark").click()
    page.reload()
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")


def test_a_key_is_asked_for_and_kept_in_the_tab_alone(new_page: Callable[..., Page], tmp_path: Path) -> None:
    with servers(tmp_path) as start:
        service = start()
        key = _make_key(service)
        page = new_page(allowed=("401",))
        page.goto(f"{service.client.base_url}/page/")
        page.get_by_label("Key").fill("rsk_wrong")
        page.get_by_role("button", name="Enter").click()
        expect(page.get_by_role("alert")).to_contain_text("not one that counts")
        page.get_by_label("Key").fill(key)
        page.get_by_role("button", name="Enter").click()
        expect(page.get_by_role("heading", name="Find out how your ego fails")).to_be_visible()
        assert page.evaluate("Object.values(sessionStorage)") == [key]
        assert key not in page.evaluate("JSON.stringify(localStorage) + document.cookie")
        page.get_by_role("button", name="Log out").click()
        expect(page.get_by_label("Key")).to_be_visible()
        assert page.evaluate("Object.values(sessionStorage)") == []
        page.close()  # it must ask for nothing once the service is gone


def _make_key(service: Service) -> str:
    made = subprocess.run(
        [sys.executable, "-m", "service.keys", "create", "--project", "default", "--scope", "admin"],
        env=service.environment,
        capture_output=True,
        text=True,
        check=True,
    )
    key = made.stdout.split()[-1]
    service.wait_until(lambda: service.client.get("/v1/campaigns").status_code == 401)
    return key


@pytest.mark.parametrize("place", ["campaigns", "campaigns/c/failures"])
def test_a_server_that_does_not_answer_is_told_on_every_screen(
    new_page: Callable[..., Page], service: Service, place: str
) -> None:
    page = new_page(allowed=("ERR_", "Failed to load", "404"))
    page.goto(f"{service.client.base_url}/page/#/{place}")
    page.get_by_role("heading", level=1).first.wait_for()
    page.wait_for_load_state("networkidle")
    banner = page.get_by_role("alert").filter(has_text="The service does not answer. The page shows")
    expect(banner).to_have_count(0)
    page.route("**/healthz", lambda route: route.abort("connectionrefused"))
    expect(banner).to_be_visible()
    page.unroute("**/healthz")
    expect(banner).to_have_count(0)


def test_nothing_is_served_outside_the_page(service: Service) -> None:
    for path in ("/page/../settings.py", "/page/%2e%2e/backend.py", "/page/assets/../../backend.py"):
        answer = httpx.get(f"{service.client.base_url}{path}")
        assert answer.status_code in (401, 404)
