"""`make screenshots`: every screen of a real campaign as a picture in results/screenshots, and the one of README.md."""

import sys
import tempfile
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, sync_playwright

from tests.server import ROOT, Service, servers
from tests.web.conftest import EXECUTABLE, PHONE, WIDE

README_PICTURE = ROOT / "service" / "web" / "replay.png"
BEFORE_CONTACT_S = 1.7  # what README's picture shows
CAMPAIGN = {
    "label": "nightly",
    "families": ["mixed", "dense"],
    "methods": ["archive", "random"],
    "seeds": [601],
    "budget": {"episodes": 150},
}
WORTH = ("preventable", "full_braking", "unavoidable")


def main(folder: Path) -> None:
    """Draws all."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as data, servers(Path(data)) as start, sync_playwright() as playwright:
        service = start("risk_sac.execution.worker", replays=3)
        campaign = service.post(**CAMPAIGN)
        service.wait(campaign)
        failure = f"campaigns/{campaign}/failures/{chosen(service, campaign)}"
        screens = {
            "campaigns": "campaigns",
            "new": "new",
            "campaign": f"campaigns/{campaign}",
            "failures": f"campaigns/{campaign}/failures",
            "replay": f"{failure}?t=-{BEFORE_CONTACT_S}",
            "pair": f"{failure}/twin/idle",
            "compare": f"campaigns/{campaign}/compare",
        }
        browser = playwright.chromium.launch(executable_path=EXECUTABLE, args=["--no-sandbox"])
        for name, place in screens.items():
            for look, viewport, scheme in (("", WIDE, "light"), ("-dark", WIDE, "dark"), ("-phone", PHONE, "light")):
                picture(
                    browser, f"{service.client.base_url}/page/#/{place}", folder / f"{name}{look}.png", viewport, scheme
                )
        README_PICTURE.write_bytes((folder / "replay.png").read_bytes())
        browser.close()


def chosen(service: Service, campaign: str) -> str:
    """A pedestrian out of hiding, which shows what the ego sees; of those the best grade, and the fastest."""

    def order(failure: dict[str, Any]) -> tuple[bool, int, float]:
        collision = failure["collision"]
        hidden = collision["judgement"]["hidden"] and collision["other_kind"] == "pedestrian"
        return not hidden, WORTH.index(collision["judgement"]["grade"]), -collision["relative_speed_mps"]

    contacts = service.get(campaign, "/failures", requirement="no_contact", limit=500)["items"]
    return str(min(contacts, key=order)["id"])


def picture(browser: Browser, address: str, file: Path, viewport: dict[str, int], scheme: str) -> None:
    """What somebody sees who comes to an address, once nothing is loading any more."""
    page = browser.new_page(viewport=viewport, color_scheme=scheme)
    page.goto(address)
    page.get_by_role("heading", level=1).first.wait_for(timeout=60_000)
    page.wait_for_load_state("networkidle")
    page.wait_for_function("() => !document.querySelector('.spinner')", timeout=60_000)
    page.screenshot(path=file)
    page.close()


if __name__ == "__main__":
    if EXECUTABLE is None:
        sys.exit("found no chromium; install it, or name one by RISK_SAC_CHROMIUM")
    main(ROOT / "results" / "screenshots")
