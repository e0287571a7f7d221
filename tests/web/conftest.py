"""The page in a real browser, on a service with a campaign."""

import fcntl
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

import sumo_nets
from tests.server import ROOT, Service, servers

NAMES = ("chromium", "chromium-browser", "google-chrome")
EXECUTABLE = os.environ.get("RISK_SAC_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
# Without a browser one test says so, in one line, instead of all.
collect_ignore_glob = [] if EXECUTABLE else ["test_[!t]*.py", "test_t[!h]*.py"]

if EXECUTABLE:
    from playwright.sync_api import Browser, ConsoleMessage, Page, expect, sync_playwright

WIDE = {"width": 1280, "height": 720}
PHONE = {"width": 390, "height": 844}
LONG_MS = 120_000  # what has not happened by then never will, however busy the machine
if EXECUTABLE:
    expect.set_options(timeout=LONG_MS)
AXE = ROOT / "service" / "web" / "node_modules" / "axe-core" / "axe.min.js"
NET = Path(sumo_nets.__path__[0]) / "dense" / "dense.net.xml"
# Numbers with more than five decimals, in texts and in fields.
UNROUNDED = """() => {
    const shown = [document.body.innerText, ...[...document.querySelectorAll("input")].map(({ value }) => value)];
    return shown.flatMap((text) => text.match(/\\d+\\.\\d{6,}/g) ?? []);
}"""
COLOURS = ["color-contrast", "link-in-text-block"]  # the rules of axe that a theme can break
HOSTILE = "<img src=x onerror=alert(1)> a very long label " + "x" * 100
CAMPAIGN = {
    "label": "night <b>7</b>",
    "families": ["low", "mixed"],
    "methods": ["archive"],
    "seeds": [3],
    "budget": {"episodes": 60},
    "odd": {"dynamic": {"behaviour": "emergency"}},
}


@pytest.fixture(scope="module")
def browser() -> Iterator["Browser"]:
    """One browser per module: its event loop would disturb other tests."""
    with sync_playwright() as playwright:
        # Containers have no sandbox of their own to give; what is opened here is ours alone.
        browser = playwright.chromium.launch(executable_path=EXECUTABLE, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Data folder and id of a finished campaign, played once for all.

    It has valid failures and refused contacts; its label is hostile.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "page"
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        known = folder / "campaign"
        if not known.exists():
            with servers(folder) as start:
                service = start("risk_sac.execution.worker")
                posted = service.post(**CAMPAIGN)
                ended = service.wait(posted)
                assert ended["state"] == "succeeded"
                assert ended["progress"]["distinct_failures"] >= 3
                assert ended["progress"]["raw_collisions"] > ended["progress"]["failures"]
                service.stop()
            known.write_text(posted)
    return folder, known.read_text()


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory, played: tuple[Path, str]) -> Iterator[Service]:
    """A service with real workers, which has the finished campaign."""
    folder = tmp_path_factory.mktemp("page") / "data"
    shutil.copytree(played[0] / "data", folder)
    with servers(folder.parent) as start:
        yield start("risk_sac.execution.worker")


@pytest.fixture(scope="session")
def campaign(service: Service, played: tuple[Path, str]) -> str:
    """The finished campaign."""
    return played[1]


@pytest.fixture(scope="session")
def network(service: Service) -> str:
    """Uploads a map under a long, hostile label; returns its id."""
    headers = {"content-type": "application/xml"}
    answer = service.client.post("/v1/networks", params={"label": HOSTILE}, content=NET.read_bytes(), headers=headers)
    return str(answer.raise_for_status().json()["id"])


@pytest.fixture
def new_page(browser: "Browser", service: Service) -> Iterator[Callable[..., "Page"]]:
    """Opens pages in their own contexts; fails on errors and foreign requests.

    That is an error on the console, an uncaught one, a violation of the content-security policy (which the
    console tells), and any request that leaves the loopback. Tests that break something on purpose name what the
    console may say by `allowed`.
    """
    said: list[str] = []
    contexts = []

    def open_page(viewport: dict[str, int] = WIDE, allowed: tuple[str, ...] = (), **options: object) -> "Page":
        context = browser.new_context(viewport=viewport, **options)
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(LONG_MS)

        def tell(text: str, url: str = "") -> None:
            if not any(each in text for each in allowed):
                said.append(f"{text} {url}")

        def tell_error(message: "ConsoleMessage") -> None:
            if message.type == "error":
                tell(message.text, message.location.get("url", ""))

        page.on("console", tell_error)
        page.on("pageerror", lambda error: tell(str(error)))
        page.on("request", lambda request: tell(f"asked {request.url}") if _leaves(request.url) else None)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert not said


def _leaves(url: str) -> bool:
    parts = urlsplit(url)
    return parts.scheme not in ("blob", "data") and parts.hostname != "127.0.0.1"


@pytest.fixture
def page_at(new_page: Callable[..., "Page"], service: Service) -> Callable[..., "Page"]:
    """A page at a place, such as `campaigns/ID/failures?grade=preventable`."""

    def open_at(place: str = "", **options: object) -> "Page":
        page = new_page(**options)
        page.goto(f"{service.client.base_url}/page/#/{place}")
        return page

    return open_at


@pytest.fixture
def check_axe() -> Callable[..., None]:
    """Checks a page by axe's accessibility rules, all unless some are named."""

    def check(page: "Page", rules: list[str] | None = None) -> None:
        page.evaluate(Path(AXE).read_text(encoding="utf-8"))  # by the debugger, which no policy forbids
        only = {"runOnly": rules} if rules else {}
        violations = page.evaluate("async (only) => (await axe.run(only)).violations", only)
        assert not violations, "\n".join(
            f"{each['id']}: {each['help']}: {[node['html'][:200] for node in each['nodes'][:3]]}" for each in violations
        )

    return check


@pytest.fixture
def check_fits(check_axe: Callable[..., None]) -> Callable[["Page"], None]:
    """Checks a page in both themes, and that no width needs scrolling."""

    def check(page: "Page") -> None:
        show_in(page, "light")
        check_axe(page)
        show_in(page, "dark")
        check_axe(page, rules=COLOURS)
        for width in (PHONE["width"], 1440):
            page.set_viewport_size({"width": width, "height": 900})
            page.wait_for_function("width => document.documentElement.scrollWidth <= width", arg=width)

    return check


def show_in(page: "Page", scheme: str) -> None:
    """Changes the system's theme, and waits until the page follows."""
    page.emulate_media(color_scheme=scheme)
    expect(page.locator("html")).to_have_attribute("data-theme", scheme)


def count(value: int | None) -> str:
    """Formats a number as the page does; a dash for no headline."""
    return "–" if value is None else str(value)
