"""Screen of one campaign: its finds, its progress, and its actions."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect
from pyarrow import parquet

from tests.server import Service, servers
from tests.web.conftest import LONG_MS, count

STEPS = ("failures", "distinct_failures", "distinct_preventable", "headline_candidates", "headline")


def funnel(page: Page) -> list[str]:
    return page.get_by_role("list", name="Funnel").locator("b").all_inner_texts()


def card(page: Page, run: str) -> Locator:
    return page.locator(f"article[data-run='{run}']")


def plot(page: Page, title: str) -> Locator:
    return page.get_by_role("group", name=re.compile(f"^{title} over episodes"))


def test_the_numbers_on_the_screen_are_the_services(
    page_at: Callable[..., Page], service: Service, campaign: str
) -> None:
    page = page_at(f"campaigns/{campaign}")
    expect(page.get_by_role("heading", name="night <b>7</b>")).to_be_visible()
    plot(page, "Sliding ECR").wait_for()
    seen = service.get(campaign)
    assert funnel(page) == [count(seen["progress"][name]) for name in STEPS]
    expect(page.locator("[data-field='done']")).to_have_text(str(seen["progress"]["episodes_done"]))
    for run in seen["runs"]:
        shown = dict(
            zip(card(page, run["id"]).locator("dt").all_inner_texts(), _values(card(page, run["id"])), strict=True)
        )
        assert [shown[name] for name in ("failures", "distinct")] == [str(run[name]) for name in STEPS[:2]]
        assert shown["preventable"] == f"{run['distinct_preventable']} ({run['distinct_published']})"
        assert shown["headline"] == count(run["metrics"]["headline"])
        for name in ("ecr", "pcr"):
            assert _number(shown[name.upper()]) == pytest.approx(100 * run["metrics"][name], abs=0.0501)
        expect(card(page, run["id"])).to_contain_text(f"{run['raw_collisions']} contacts")


def test_the_funnel_names_the_most_likely_severe_failure(
    page_at: Callable[..., Page], service: Service, campaign: str
) -> None:
    table = service.get(campaign, "/failure-table")
    heaviest = max(range(len(table["ids"])), key=lambda i: (table["weight"][i], -i))
    line = page_at(f"campaigns/{campaign}").get_by_text("Most likely and severe:")
    expect(line.get_by_role("link")).to_have_attribute(
        "href", f"#/campaigns/{campaign}/failures/{table['ids'][heaviest]}"
    )
    assert table["severity"][heaviest] is None or table["severity"][heaviest] in line.inner_text()


def test_the_pointer_reads_the_curves_of_the_service(
    page_at: Callable[..., Page], service: Service, campaign: str
) -> None:
    page = page_at(f"campaigns/{campaign}")
    curves = {run["family"]: run for run in service.get(campaign, "/curves", points=200)["runs"]}
    for title, name, written in (
        ("Sliding ECR", "window_ecr", lambda value: 100 * value),
        ("Distinct failures", "distinct", float),
    ):
        area = plot(page, title)
        area.focus()
        area.press("ArrowRight")  # from the newest episode nowhere: the pointer comes to it
        shown = area.get_by_role("status")
        expect(shown).to_contain_text("After 60 episodes")
        for family, run in curves.items():
            line = shown.locator("span", has_text=f"archive, {family}").last.inner_text()
            assert _number(line.removeprefix(f"archive, {family}")) == pytest.approx(written(run[name][-1]), abs=0.0501)
        area.press("ArrowLeft")
        expect(shown).to_contain_text("After 59 episodes")


def test_strips_and_cards_say_what_drove_the_episodes(
    page_at: Callable[..., Page], service: Service, campaign: str
) -> None:
    page = page_at(f"campaigns/{campaign}")
    strips = page.get_by_role("region", name="Driven by", exact=True)
    for run in service.get(campaign)["runs"]:
        drove = run["metrics"]["episodes_driven_by"]
        assert set(drove) == {"script", "random"}
        said = f"{drove['script']} episodes driven by a script, {drove['random']} at random"
        expect(strips.locator(f"[data-run='{run['id']}']").get_by_role("img", name=said)).to_be_visible()
        expect(card(page, run["id"])).to_contain_text(said)
    expect(page.get_by_text("Shaded: the warm-up")).to_have_count(0)  # no policy ever drove


def test_importance_and_coverage_are_the_services(
    page_at: Callable[..., Page], service: Service, campaign: str
) -> None:
    page = page_at(f"campaigns/{campaign}")
    table = page.get_by_role("region", name="Importance of scene parameters")
    matrix = page.get_by_role("region", name="Coverage of two parameters")
    for family in service.get(campaign, "/scenes")["families"]:
        page.get_by_role("group", name="Family of the scenes").get_by_role("button", name=family["family"]).click()
        expect(table.locator("tbody tr")).to_have_count(len(family["parameters"]))
        for row, parameter in zip(table.locator("tbody tr").all(), family["parameters"], strict=True):
            expect(row).to_have_attribute("data-parameter", parameter["name"])
            expect(row.locator("td").nth(1)).to_have_text(f"{parameter['effect']:.2f}")
        down, across = family["pairs"][0]["parameters"]
        page.get_by_role("combobox", name="Down").select_option(across)  # turned around
        page.get_by_role("combobox", name="Across").select_option(down)
        played, failed = (list(map(list, zip(*family["pairs"][0][name], strict=True))) for name in ("played", "failed"))
        expect(matrix.locator("tbody td")).to_have_text(
            [
                f"{bad} of {all_}" if all_ else "–"
                for row, bads in zip(played, failed, strict=True)
                for all_, bad in zip(row, bads, strict=True)
            ]
        )
    page.get_by_role("combobox", name="Across").select_option(across)
    expect(page.get_by_text("Choose two different parameters.")).to_be_visible()


def test_a_running_campaign_is_followed_to_its_end_without_a_reload(
    page_at: Callable[..., Page], service: Service
) -> None:
    running = service.post(label="live", families=["low"], methods=["random"], seeds=[5], budget={"episodes": 12})
    page = page_at(f"campaigns/{running}")
    page.evaluate("window.neverReloaded = true")
    expect(page.get_by_text("running", exact=True).first).to_be_visible(timeout=LONG_MS)
    plot(page, "Realism cost").wait_for()  # begins with the first episode
    expect(page.get_by_text("succeeded", exact=True).first).to_be_visible(timeout=LONG_MS)
    ended = service.wait(running)
    expect(page.locator("[data-field='done']")).to_have_text("12")
    assert funnel(page) == [count(ended["progress"][name]) for name in STEPS]
    area = plot(page, "Realism cost")
    area.focus()
    area.press("ArrowRight")
    expect(area.get_by_role("status")).to_contain_text("After 12 episodes")
    expect(page.get_by_role("button", name="Delete")).to_be_visible()
    assert page.evaluate("window.neverReloaded")


def test_events_draw_curves_that_equal_those_of_the_service(page_at: Callable[..., Page], service: Service) -> None:
    running = service.post(families=["low"], methods=["archive"], seeds=[601], budget={"episodes": 24})
    page = page_at(f"campaigns/{running}", allowed=("ERR_FAILED",))
    plot(page, "Sliding ECR").wait_for()
    page.route("**/curves?*", lambda route: route.abort())  # from here on by events alone
    area = plot(page, "Distinct failures")
    service.wait(running)
    curve = service.get(running, "/curves", points=200)["runs"][0]
    area.focus()
    for _ in range(3):  # the newest may be drawn a moment later
        area.press("ArrowRight")
    expect(area.get_by_role("status")).to_contain_text("After 24 episodes")
    expect(area.get_by_role("status").locator("span b")).to_have_text(str(curve["distinct"][-1]))


def test_cancelling_asks_first(page_at: Callable[..., Page], service: Service) -> None:
    running = service.post(families=["low"], methods=["random"], seeds=[6], budget={"episodes": 5000})
    page = page_at(f"campaigns/{running}")
    page.get_by_role("button", name="Cancel").click()
    question = page.get_by_role("dialog", name="Cancel this campaign?")
    expect(question).to_be_visible()
    page.keyboard.press("Escape")
    expect(question).to_have_count(0)
    assert service.get(running)["state"] in ("queued", "running")
    page.get_by_role("button", name="Cancel").click()
    question.get_by_role("button", name="Cancel the campaign").click()
    expect(page.get_by_text("cancelled", exact=True).first).to_be_visible(timeout=LONG_MS)
    assert service.wait(running)["state"] == "cancelled"
    page.get_by_role("button", name="Delete").click()
    page.get_by_role("button", name="Delete for good").click()
    expect(page).to_have_url(re.compile("#/campaigns$"))
    assert service.client.get(f"/v1/campaigns/{running}").status_code == 404


def test_a_campaign_comes_back_with_its_server(new_page: Callable[..., Page], tmp_path: Path) -> None:
    with servers(tmp_path) as start:
        service = start()
        running = service.post(budget={"episodes": 100_000})
        page = new_page(allowed=("ERR_", "Failed to load"))
        page.goto(f"{service.client.base_url}/page/#/campaigns/{running}")
        done = page.locator("[data-field='done']")
        expect(done).not_to_have_text("0")
        service.stop()
        expect(page.get_by_text("The service does not answer").first).to_be_visible()
        before = done.inner_text()  # what was said last stays
        assert before != "0"
        service.start()
        expect(page.get_by_text("The service does not answer")).to_have_count(0)
        expect(done).not_to_have_text(before)


def test_nobody_asks_for_anything_while_the_page_is_hidden(page_at: Callable[..., Page], service: Service) -> None:
    running = service.post(families=["low"], methods=["random"], seeds=[7], budget={"episodes": 5000})
    page = page_at(f"campaigns/{running}")
    plot(page, "Sliding ECR").wait_for()
    hide = "to => { Object.defineProperty(document, 'hidden', {value: to, configurable: true});"
    hide += " document.dispatchEvent(new Event('visibilitychange')); }"
    asked: list[str] = []
    page.evaluate(hide, True)
    page.on("request", lambda request: asked.append(request.url))
    done = service.get(running)["progress"]["episodes_done"]
    service.wait_for(running, lambda seen: seen["progress"]["episodes_done"] > done + 5)
    assert asked == []
    with page.expect_request("**/events?newest=*"):
        page.evaluate(hide, False)
    service.client.post(f"/v1/campaigns/{running}/cancel")
    service.wait(running)


def test_what_was_posted_can_be_taken_away(
    page_at: Callable[..., Page], service: Service, campaign: str, tmp_path: Path
) -> None:
    page = page_at(f"campaigns/{campaign}")
    with page.expect_download() as download:
        page.get_by_role("button", name="Spec JSON").click()
    download.value.save_as(tmp_path / "spec.json")
    assert json.loads((tmp_path / "spec.json").read_text()) == service.get(campaign, "/spec")
    with page.expect_download() as download:
        page.get_by_role("button", name="Episodes", exact=True).click()
    download.value.save_as(tmp_path / "episodes.parquet")
    assert (
        parquet.read_metadata(tmp_path / "episodes.parquet").num_rows
        == service.get(campaign)["progress"]["episodes_done"]
    )
    expect(page.get_by_role("link", name="Clone")).to_have_attribute("href", f"#/new?from={campaign}")
    expect(page.get_by_role("link", name="Compare methods")).to_have_attribute(
        "href", f"#/campaigns/{campaign}/compare"
    )


def _values(run: Locator) -> list[str]:
    return run.locator("dd").all_inner_texts()


def _number(text: str) -> float:
    return float(text.replace("%", "").strip())
