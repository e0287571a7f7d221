"""`make screenshots`: pictures of every screen, and the one of README.md.

`python -m tests.web.screenshots --data DIR SCREEN ...` draws some, of campaigns that are played once and kept in DIR.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Literal, get_args

from playwright.sync_api import Browser, Page, sync_playwright

from tests.server import ROOT, Service, servers
from tests.web.conftest import EXECUTABLE, NET, PHONE, WIDE
from tests.web.test_screens import SCREENS, heading

Scheme = Literal["dark", "light"]
FOLDER = ROOT / "results" / "screenshots"
README_PICTURE = ROOT / "service" / "web" / "replay.png"
BEFORE_CONTACT_S = 1.7  # what README's picture shows
FORMS = {"desk": {"width": 1440, "height": 900}, "phone": PHONE}
LONG_LABEL = "crossroads of the old town, as exported on the first of March, with all its bicycle lanes and signals"
SEARCHED = {"families": ["mixed", "dense"], "seeds": [601], "budget": {"episodes": 150}}
NIGHTLY = SEARCHED | {"label": "nightly", "methods": ["risk-sac-diverse", "archive", "random"]}
SECOND = {"label": "ego with a slow response", "methods": ["archive"], "seeds": [602], "budget": {"episodes": 60}}
LIVE = SEARCHED | {"label": "at work", "methods": ["risk-sac-diverse", "archive"], "budget": {"episodes": 20_000}}
WIDE_FIRST = {"failures"}  # a phone hides the plots that are prepared
GRADES = ("preventable", "full_braking", "unavoidable")

# Besides the screens of test_screens.py, which are prepared to show the most.
PLAIN: dict[str, tuple[str, Callable[[Page], None]]] = {
    "cards": ("campaigns/{campaign}/failures", heading),
    "live": ("campaigns/{live}", heading),
    "picker": ("compare", heading),
    "several": ("compare?ids={campaign},{second}", heading),
    "docs": ("../../docs", lambda page: page.locator(".opblock").first.wait_for()),
}


def main(wanted: list[str], data: Path) -> None:
    """Draws the named screens, or all, in both themes and widths."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    data.mkdir(parents=True, exist_ok=True)
    screens = {name: each for name, each in (SCREENS | PLAIN).items() if name in wanted or not wanted}
    with servers(data) as start, sync_playwright() as playwright, ExitStack() as ending:
        service = start("risk_sac.execution.worker", replays=3)
        ids = played(service, data / "ids.json")
        if "live" in screens:
            ids["live"] = service.post(**LIVE)
            ending.callback(service.client.post, f"/v1/campaigns/{ids['live']}/cancel")
            service.wait_for(ids["live"], lambda seen: seen["progress"]["failures"] > 0)
        browser = playwright.chromium.launch(executable_path=EXECUTABLE, args=["--no-sandbox"])
        for name, (place, prepare) in screens.items():
            address = f"{service.client.base_url}/page/#/{place.format(**ids)}".replace("page/#/../../", "")
            for form, viewport in FORMS.items():
                for scheme in get_args(Scheme):
                    page = opened(browser, address, prepare, FORMS["desk"] if name in WIDE_FIRST else viewport, scheme)
                    page.set_viewport_size(viewport)
                    page.screenshot(path=FOLDER / f"{name}-{form}-{scheme}.png", full_page=True)
                    page.close()
        if "replay" in screens:
            place = f"campaigns/{ids['campaign']}/failures/{ids['failure']}?t=-{BEFORE_CONTACT_S}"
            page = opened(browser, f"{service.client.base_url}/page/#/{place}", SCREENS["replay"][1], WIDE, "light")
            page.screenshot(path=README_PICTURE)
        browser.close()


def played(service: Service, known: Path) -> dict[str, str]:
    """Returns ids of two campaigns, a failure and a map, made once."""
    if not known.exists():
        campaign, second = service.post(**NIGHTLY), service.post(**SECOND)
        for each in (campaign, second):
            service.wait(each)
        query = {"label": LONG_LABEL}
        headers = {"content-type": "application/xml"}
        network = service.client.post("/v1/networks", params=query, content=NET.read_bytes(), headers=headers).json()
        failure = chosen(service, campaign)
        ids = {"campaign": campaign, "second": second, "network": network["id"], "failure": failure}
        known.write_text(json.dumps(ids), encoding="utf-8")
    return dict(json.loads(known.read_text(encoding="utf-8")))


def chosen(service: Service, campaign: str) -> str:
    """Chooses a failure: a hidden pedestrian first, then grade, then speed."""

    def order(failure: dict[str, Any]) -> tuple[bool, int, float]:
        collision = failure["collision"]
        hidden = collision["judgement"]["hidden"] and collision["other_kind"] == "pedestrian"
        return not hidden, GRADES.index(collision["judgement"]["grade"]), -collision["relative_speed_mps"]

    contacts = service.get(campaign, "/failures", requirement="no_contact", limit=500)["items"]
    return str(min(contacts, key=order)["id"])


def opened(
    browser: Browser, address: str, prepare: Callable[[Page], None], viewport: dict[str, int], scheme: Scheme
) -> Page:
    """A page at an address, prepared, once nothing is loading any more."""
    page = browser.new_page(viewport=viewport, color_scheme=scheme)
    page.set_default_timeout(60_000)
    page.goto(address)
    prepare(page)
    page.wait_for_function("() => !document.querySelector('.spinner')")
    show_all(page)
    return page


def show_all(page: Page) -> None:
    """Scrolls to the end and back: pictures load when in view."""
    page.evaluate("""async () => {
        for (let y = 0; y < document.documentElement.scrollHeight; y += 500) {
            scrollTo(0, y);
            await new Promise(requestAnimationFrame);
        }
    }""")
    page.wait_for_function("() => [...document.images].every(({ complete }) => complete)")
    page.wait_for_function("() => !document.body.innerText.includes('Loading …')")
    page.evaluate("scrollTo(0, 0)")
    # Cards that come back into view load their pictures once they have stayed there.
    page.wait_for_function("() => [...document.querySelectorAll('div.thumbnail')].every(({ innerText }) => innerText)")


if __name__ == "__main__":
    if EXECUTABLE is None:
        sys.exit("found no chromium; install it, or name one by RISK_SAC_CHROMIUM")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("screens", nargs="*", metavar="SCREEN", help=", ".join(SCREENS | PLAIN))
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder of the campaigns, kept for the next time")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        main(options.screens, options.data or Path(folder))
