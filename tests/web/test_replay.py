"""Replay of a failure: drawn as recorded, at and between frames."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from tests.server import Service

DRAWN = "(canvas) => canvas.drawn"
LATE_DRIVERS = ("idle", "careful")


@pytest.fixture(scope="module")
def failure(service: Service, campaign: str) -> dict[str, Any]:
    """Returns a failure in full, with its path on the page."""
    listed = service.get(campaign, "/failures", limit=200)["items"]
    chosen = max(listed, key=lambda each: (each["repetition"] is not None, each["id"].startswith("mixed")))
    known = service.get(campaign, f"/failures/{chosen['id']}")
    known["place"] = f"campaigns/{campaign}/failures/{chosen['id']}"
    return known


def times(failure: dict[str, Any]) -> np.ndarray:
    """From the contact, as the page counts."""
    series = failure["series"]
    counted: np.ndarray = np.array(series["time_s"]) - series["released_s"] - failure["collision"]["time_s"]
    return counted


def column(rows: list[list[float | None]], actor: int) -> np.ndarray:
    return np.array([np.nan if row[actor] is None else row[actor] for row in rows], dtype=float)


def stage(page: Page) -> Locator:
    """The stage, once it has drawn something."""
    canvas = page.locator("canvas.stage[data-time]").first
    canvas.wait_for()
    return canvas


def go_to(page: Page, time_s: float) -> dict[str, Any]:
    """What is drawn at a time that the address asks for."""
    page.evaluate("(t) => { location.hash = location.hash.split('?')[0] + '?t=' + t }", time_s)
    canvas = stage(page)
    expect(canvas).to_have_attribute("data-time", f"{time_s:.3f}")
    drawn: dict[str, Any] = canvas.evaluate(DRAWN)
    return drawn


def assert_as_recorded(drawn: dict[str, Any], series: dict[str, Any], time_s: np.ndarray) -> None:
    """Checks centres and headings, interpolated by numpy, independent of the page."""
    now = drawn["time_s"]
    seen = {actor["id"]: actor for actor in drawn["actors"]}
    for i, name in enumerate(series["ids"]):
        x, y, heading = (column(series[key], i) for key in ("x_m", "y_m", "heading_rad"))
        expected = [np.interp(now, time_s, values) for values in (x, y, np.unwrap(heading))]
        if np.isnan(expected).any():
            assert name not in seen
            continue
        assert [seen[name]["x_m"], seen[name]["y_m"]] == pytest.approx(expected[:2], abs=1e-6)
        assert np.cos(seen[name]["heading_rad"] - expected[2]) == pytest.approx(1, abs=1e-9)
        frame = int(np.searchsorted(time_s, now + 1e-6, side="right")) - 1
        assert seen[name]["seen"] is (series["visible"][max(frame, 0)][i] is not False)


def test_positions_are_those_of_the_series_at_frames_and_between(
    failure: dict[str, Any], page_at: Callable[..., Page]
) -> None:
    page = page_at(failure["place"])
    time_s = times(failure)
    last = len(time_s) - 1
    for step in (0, 1, last // 3, last // 2, last - 1, last):
        drawn = go_to(page, float(time_s[step]))
        assert (drawn["index"], drawn["share"]) == (step, 0)
        assert_as_recorded(drawn, failure["series"], time_s)
    for share in (0.1, 0.5, 0.93):
        for step in (0, last // 2, last - 1):
            drawn = go_to(page, float(time_s[step] + share * (time_s[step + 1] - time_s[step])))
            assert drawn["index"] == step
            assert drawn["share"] == pytest.approx(share, abs=1e-3)
            assert_as_recorded(drawn, failure["series"], time_s)


def test_who_struck_and_who_was_struck_are_told_apart(failure: dict[str, Any], page_at: Callable[..., Page]) -> None:
    drawn = stage(page_at(failure["place"])).evaluate(DRAWN)
    parts = {actor["id"]: actor["part"] for actor in drawn["actors"]}
    assert parts["ego"] == "ego"
    assert parts[failure["collision"]["other_id"]] == "striker"
    assert list(parts.values()).count("striker") == 1


def test_signals_on_the_stage_show_what_the_series_recorded(
    failure: dict[str, Any], page_at: Callable[..., Page]
) -> None:
    page = page_at(failure["place"])
    series, time_s = failure["series"], times(failure)
    ahead = [step for step, colour in enumerate(series["signal"]) if colour != "none"]
    assert ahead, "wants a failure with a signal"
    page.wait_for_function(
        "() => document.querySelector('canvas.stage')?.drawn?.signals.length"
    )  # the roads come later
    for step in (ahead[0], ahead[-1]):
        lamps = {each["lamp"] for each in go_to(page, float(time_s[step]))["signals"]}
        assert series["signal"][step] in lamps


def test_keys_step_frame_by_frame_and_play_and_pause(failure: dict[str, Any], page_at: Callable[..., Page]) -> None:
    page = page_at(failure["place"])
    time_s = times(failure)
    canvas = stage(page)

    def shows(step: int) -> None:
        expect(canvas).to_have_attribute("data-time", f"{time_s[step]:.3f}")

    page.keyboard.press("Home")
    shows(0)
    for step, key in enumerate(("ArrowRight", ".", "ArrowRight"), start=1):
        page.keyboard.press(key)
        shows(step)
    for step, key in ((2, "ArrowLeft"), (1, ",")):
        page.keyboard.press(key)
        shows(step)
    page.get_by_role("slider", name="Time from the contact").focus()
    page.keyboard.press("ArrowRight")
    shows(2)
    page.keyboard.press("End")
    shows(-1)
    page.keyboard.press("Home")
    page.keyboard.press(" ")
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    page.wait_for_function("(t) => Number(document.querySelector('canvas.stage').dataset.time) > t", arg=time_s[2])
    page.keyboard.press(" ")
    expect(page.get_by_role("button", name="Play", exact=True)).to_be_visible()


def test_the_camera_follows_lets_go_zooms_and_fits(failure: dict[str, Any], page_at: Callable[..., Page]) -> None:
    page = page_at(failure["place"])
    canvas = stage(page)
    follow = page.get_by_role("button", name="Follow")

    def ego() -> tuple[float, float]:
        drawn = canvas.evaluate(DRAWN)
        return next((each["px"], each["py"]) for each in drawn["actors"] if each["id"] == "ego")

    expect(follow).to_have_attribute("aria-pressed", "true")
    held = ego()
    page.keyboard.press("ArrowRight")
    assert ego() == pytest.approx(held, abs=20)  # it may turn, the ground moves under it
    before = canvas.evaluate(DRAWN)["camera"]["scale"]
    page.keyboard.press("+")
    assert canvas.evaluate(DRAWN)["camera"]["scale"] == pytest.approx(1.25 * before)
    page.get_by_role("button", name="Farther").click()
    assert canvas.evaluate(DRAWN)["camera"]["scale"] == pytest.approx(before)
    box = canvas.bounding_box()
    assert box is not None
    held = ego()
    page.mouse.move(box["x"] + 200, box["y"] + 150)
    page.mouse.down()
    page.mouse.move(box["x"] + 260, box["y"] + 130)
    page.mouse.up()
    expect(follow).to_have_attribute("aria-pressed", "false")
    assert ego() == pytest.approx((held[0] + 60, held[1] - 20), abs=2)
    page.mouse.wheel(0, -400)
    assert canvas.evaluate(DRAWN)["camera"]["scale"] > before
    page.keyboard.press("0")
    striker = next(each for each in canvas.evaluate(DRAWN)["actors"] if each["part"] == "striker")
    for px, py in (ego(), (striker["px"], striker["py"])):
        assert 0 < px < box["width"]
        assert 0 < py < box["height"]
    page.keyboard.press("f")
    expect(follow).to_have_attribute("aria-pressed", "true")


def test_a_table_says_what_is_seen(failure: dict[str, Any], page_at: Callable[..., Page]) -> None:
    page = page_at(failure["place"])
    series = failure["series"]
    step = len(series["time_s"]) // 2
    go_to(page, float(times(failure)[step]))
    region = page.get_by_role("region", name="Actors at this time")
    expect(region).to_have_attribute("aria-live", "off")
    present = [i for i, x_m in enumerate(series["x_m"][step]) if x_m is not None]
    rows = region.locator("tbody tr")
    expect(rows).to_have_count(len(present))
    for row, i in enumerate(present):
        expect(rows.nth(row)).to_contain_text(series["ids"][i])
        expect(rows.nth(row)).to_contain_text(f"{series['speed_mps'][step][i]:.1f} m/s")
        if i:
            expect(rows.nth(row)).to_contain_text("in view" if series["visible"][step][i] else "not seen")


def test_the_verdict_is_told_in_words(failure: dict[str, Any], page_at: Callable[..., Page]) -> None:
    verdict = page_at(failure["place"]).get_by_role("region", name="Verdict")
    judgement = failure["collision"]["judgement"]
    said = verdict.locator(".verdict-grade").inner_text().lower()
    rows = verdict.get_by_role("row").filter(has_text="prevent it").get_by_role("rowheader").all_inner_texts()
    expect(verdict.get_by_role("row")).to_have_count(1 + len(judgement["drivers"]))
    assert all(driver.lower() in said for driver in rows)
    assert said.startswith("none of the reference drivers") == (not rows)
    assert said.startswith("only ") == (rows == ["Full braking at once"])
    happened, fault, plausible = verdict.locator(".verdict-sentences p").all_inner_texts()
    assert failure["collision"]["other_id"] in happened
    assert judgement["severity"] in happened
    at_fault = {"ego": "The ego is at fault", "shared": "Both are at fault", "other": "The other road user is at fault"}
    assert fault.startswith(at_fault[judgement["fault"]])
    assert plausible == f"It is {judgement['plausibility']['verdict']}: {judgement['plausibility']['sentence']}."
    if failure["repetition"]:
        expect(verdict).to_contain_text(f"{failure['repetition']['same']} of {failure['repetition']['times']} replays")


def test_what_was_refused_says_by_which_rules(service: Service, campaign: str, page_at: Callable[..., Page]) -> None:
    contacts = service.get(campaign, "/failures", tier="raw", limit=200)["items"]
    refused = next(each for each in contacts if not all(each["collision"]["verdicts"].values()))
    page = page_at(f"campaigns/{campaign}/failures/{refused['id']}")
    rules = [rule for rule, passed in refused["collision"]["verdicts"].items() if not passed]
    expect(page.locator(".verdict-refused li")).to_have_count(len(rules))


def test_picture_and_data_can_be_taken_along(failure: dict[str, Any], page_at: Callable[..., Page]) -> None:
    page = page_at(failure["place"])
    stage(page)
    with page.expect_download() as taken:
        page.get_by_role("button", name="Picture (PNG)").click()
    with Image.open(taken.value.path()) as picture:
        assert picture.size[0] > 300
    with page.expect_download() as taken:
        page.get_by_role("button", name="Data (JSON)").click()
    assert json.loads(taken.value.path().read_text())["id"] == failure["id"]
    expect(page.get_by_role("region", name="Play it again, anywhere")).to_contain_text("risk-sac replay")
    page.get_by_label("For other tools").select_option("GIF")
    with page.expect_download() as taken:
        page.get_by_role("button", name="Download").click()
    assert taken.value.suggested_filename == f"{failure['id']}.gif"
    with Image.open(taken.value.path()) as animation:
        assert animation.n_frames > 10


@pytest.mark.parametrize("kind", LATE_DRIVERS)
def test_a_twin_is_shown_at_the_same_time_as_its_failure(
    kind: str, failure: dict[str, Any], service: Service, page_at: Callable[..., Page]
) -> None:
    page = page_at(f"{failure['place']}/twin/{kind}?t=-0.65")
    canvases = page.locator("canvas.stage[data-time]")
    canvases.nth(1).wait_for()
    answer = service.client.get(f"/v1/{failure['place']}/twins/{kind}")
    twin = answer.json()
    zero = twin["series"]["released_s"] + failure["collision"]["time_s"]
    for canvas, series in ((canvases.nth(0), failure["series"]), (canvases.nth(1), twin["series"])):
        expect(canvas).to_have_attribute("data-time", "-0.650")
        assert_as_recorded(canvas.evaluate(DRAWN), series, np.array(series["time_s"]) - zero)
    cameras = [canvas.evaluate(DRAWN)["camera"] for canvas in (canvases.nth(0), canvases.nth(1))]
    assert cameras[0] == pytest.approx(cameras[1])
    expect(page.get_by_role("region", name="Its twin")).to_contain_text(twin["outcome"][1:])
    expect(page.locator(".time-plot")).to_have_count(3)


def test_a_twin_that_cannot_be_played_says_so(
    failure: dict[str, Any], new_page: Callable[..., Page], service: Service
) -> None:
    page = new_page(allowed=("409",))
    body = {"title": "Conflict", "status": 409, "detail": "the scene has <b>other</b> parameters now"}
    page.route("**/twins/idle", lambda route: route.fulfill(status=409, json=body))
    page.goto(f"{service.client.base_url}/page/#/{failure['place']}/twin/idle")
    twin = page.get_by_role("region", name="Its twin")
    expect(twin).to_contain_text("This twin cannot be played.")
    expect(twin).to_contain_text("the scene has <b>other</b> parameters now")
