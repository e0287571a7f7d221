"""Methods and campaigns side by side, and the printed report."""

import csv
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.server import Service, servers
from tests.web.conftest import CAMPAIGN, COLOURS, PHONE, count


@pytest.fixture(scope="session")
def methods(service: Service) -> str:
    """Finished campaign of two methods and seeds, with a hostile label."""
    posted = service.post(
        label="<img src=x onerror=alert(1)> night",
        families=["low"],
        methods=["archive", "random"],
        seeds=[0, 5],  # of these, some fail and follow scripts within few episodes
        budget={"episodes": 16},
    )
    assert service.wait(posted)["state"] == "succeeded"
    return posted


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"\d+\.\d", text)]


def per_cent(*values: float) -> Any:
    """As they are shown, rounded to a tenth of a per cent."""
    return pytest.approx([100 * value for value in values], abs=0.0501)


def row_of(page: Page, key: str, family: str = "low") -> Locator:
    return page.locator(f"section[aria-labelledby='family-{family}'] tr[data-row='{key}']")


def test_the_numbers_of_a_report_are_the_services(
    page_at: Callable[..., Page], service: Service, methods: str, check_axe: Callable[[Page], None]
) -> None:
    page = page_at(f"campaigns/{methods}/compare")
    table = service.get(methods, "/table", format="json")
    assert len(table["cells"]) == 2
    for cell in table["cells"]:
        row = row_of(page, cell["method"])
        expect(row).to_be_visible()
        shown = row.locator("td").all_inner_texts()
        counts = [text.strip() for text in (*shown[:3], *shown[5:])]
        assert counts == [*_kinds_in(cell), count(len(cell["seeds"])), count(cell["episodes"])]
        for name, text in zip(("ecr", "pcr"), shown[3:5], strict=True):
            estimate = cell["estimates"][name]
            assert numbers(text) == per_cent(estimate["mean"], estimate["low"], estimate["high"])
        funnel = page.get_by_role("group", name=f"Funnel of {cell['method']}")
        assert funnel.locator("b").all_inner_texts() == [
            count(cell[name])
            for name in ("failures", "distinct_failures", "distinct_preventable", "headline_candidates", "headline")
        ]
    tests = page.get_by_role("region", name=f"{table['reference']} against the others").locator("tbody tr")
    assert tests.count() == sum(test["family"] == "low" for test in table["tests"])
    for name in service.get(methods, "/clusters")["families"]["low"]["clusters"]:
        expect(page.get_by_role("link", name=name["name"], exact=True)).to_have_attribute(
            "href", f"#/campaigns/{methods}/failures/{name['representative']}"
        )
    for cell in table["cells"]:
        in_row = f"[data-of='{cell['method']}'] td"
        drivers = page.get_by_role("region", name="PCR by reference driver: low").locator(in_row)
        told = cell["pcr_by_driver"].values()
        shown = drivers.filter(has_not_text="–").all_inner_texts()
        assert [numbers(text) for text in shown] == [
            per_cent(each["pcr"], each["pcr_low"], each["pcr_high"]) for each in told
        ]
        classes = page.get_by_role("region", name="Severity and fault: low").locator(in_row)
        counts = [cell["by_severity"].get(name, 0) for name in ("severe", "moderate", "minor")]
        counts += [cell["by_fault"].get(name, 0) for name in ("ego", "shared", "other")]
        shown = [int(text.split()[0].replace("–", "0")) for text in classes.all_inner_texts()]
        assert shown == counts
        drove = page.get_by_role("region", name="Driven by: low").locator(in_row).all_inner_texts()
        episodes = [cell["episodes_driven_by"].get(name, 0) for name in ("script", "random")]
        assert [int(text.split()[0]) for text in drove[:2]] == episodes
        assert sum(episodes) == cell["episodes"]
    page.get_by_text("More measures").click()
    check_axe(page)


def test_a_report_and_its_figures_can_be_taken_away(
    page_at: Callable[..., Page], service: Service, methods: str, tmp_path: Path
) -> None:
    page = page_at(f"campaigns/{methods}/compare")
    report = page.get_by_role("group", name="Download the report")
    for button, ending in (("CSV", "csv"), ("Markdown", "md"), ("JSON", "json")):
        assert _saved(page, report.get_by_role("button", name=button), tmp_path).suffix == f".{ending}"
    page.get_by_text("All figures").click()
    name = service.get(methods, "/figures")["items"][0]["name"]
    figure = page.locator("details figure").first
    image = figure.locator("img")
    expect(image).to_be_visible()
    assert image.evaluate("image => image.decode().then(() => image.naturalWidth)") > 100
    picture = _saved(page, figure.get_by_role("button", name="PNG"), tmp_path)
    assert picture.name == f"{name}.png"
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_page_works_below_the_path_that_a_proxy_has_the_service_at(
    new_page: Callable[..., Page], played: tuple[Path, str], tmp_path: Path
) -> None:
    shutil.copytree(played[0] / "data", tmp_path / "data")
    with servers(tmp_path) as start:
        page, base = new_page(), str(start("risk_sac.execution.worker", root_path="/sim").client.base_url)
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.route(
            f"{base}/sim/**",
            lambda route: route.fulfill(response=route.fetch(url=route.request.url.replace("/sim/", "/", 1))),
        )
        page.goto(f"{base}/sim/page/#/campaigns/{played[1]}/compare")
        page.get_by_text("All figures").click()
        image = page.locator("details figure img").first
        expect(image).to_be_visible()
        assert image.evaluate("image => image.decode().then(() => image.naturalWidth)") > 100
        assert [url for url in asked if not url.startswith((f"{base}/sim/", "blob:"))] == []
        page.goto(f"{base}/sim/docs")
        expect(page.locator(".servers select")).to_have_value("/sim")
        page.close()


def test_two_campaigns_stand_beside_each_other(
    page_at: Callable[..., Page],
    service: Service,
    campaign: str,
    methods: str,
    check_axe: Callable[[Page], None],
    tmp_path: Path,
) -> None:
    page = page_at("compare")
    for label in ("night <b>7</b>", "<img src=x onerror=alert(1)> night"):
        page.get_by_role("checkbox", name=label).check()
    page.get_by_role("button", name="Compare 2 campaigns").click()
    for at, one in enumerate((campaign, methods)):
        for total in service.get(one, "/results")["totals"]:
            _check_total(row_of(page, f"{one} {total['method']}", total["family"]), "AB"[at], total)
    posted = dict.fromkeys(("families", "methods", "seeds", "budget.episodes", "odd.dynamic.behaviour"))
    differing = page.get_by_role("region", name="Differing fields")
    assert [row.inner_text() for row in differing.locator("tbody th").all()] == list(posted)
    expect(differing.get_by_role("row", name="budget.episodes")).to_contain_text("60")
    saved = _saved(page, page.get_by_role("button", name="CSV"), tmp_path)
    rows = list(csv.DictReader(saved.read_text().splitlines()))
    assert {(row["campaign"], row["family"], row["method"]) for row in rows} == {
        (one, total["family"], total["method"])
        for one in (campaign, methods)
        for total in service.get(one, "/results")["totals"]
    }
    saved = _saved(page, page.get_by_role("button", name="JSON"), tmp_path)
    assert len(json.loads(saved.read_text())) == len(rows)
    check_axe(page)


def _check_total(row: Locator, letter: str, total: dict[str, Any]) -> None:
    expect(row.get_by_role("rowheader")).to_have_text(f"{letter}: {total['method']}")
    for name, text in zip(("ecr", "pcr"), row.locator("td.rate").all_inner_texts(), strict=True):
        assert numbers(text) == per_cent(total[name], total[f"{name}_low"], total[f"{name}_high"])
    shown = [text.strip() for text in row.locator("td").all_inner_texts()]
    assert [*shown[:3], *shown[5:]] == [*_kinds_in(total), count(total["runs"]), count(total["episodes"])]


def _kinds_in(row: dict[str, Any]) -> list[str]:
    """Returns a row's texts of headline, distinct and preventable kinds."""
    headline, preventable = count(row["headline"]), count(row["distinct_preventable"])
    published = "" if row["headline"] is None else f" ({count(row['headline_published'])})"
    return [
        f"{headline}{published}",
        count(row["distinct_failures"]),
        f"{preventable} ({count(row['distinct_published'])})",
    ]


def _saved(page: Page, button: Locator, folder: Path) -> Path:
    with page.expect_download() as download:
        button.click()
    target = folder / download.value.suggested_filename
    download.value.save_as(target)
    return target


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
    check_axe(page, rules=COLOURS)
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
    expect(page.get_by_role("heading", name="Coverage of scene parameters")).to_be_visible()
    box = page.locator("main").bounding_box()
    assert box is not None
    assert box["x"] + box["width"] <= PHONE["width"]
    for block in page.locator("main > *").all():
        around = block.bounding_box()
        assert around is None or around["x"] + around["width"] <= PHONE["width"]
