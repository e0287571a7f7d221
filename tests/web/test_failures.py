"""Screen of failures: cards, plots and filters over the service's data."""

import json
import re
from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from tests.server import Service
from tests.web.conftest import PHONE

DRAWN = "() => [...document.querySelectorAll('.cards li')].map(({ dataset }) => dataset.at)"
# Text that its element cuts, and cards that reach into another.
CUT = """() => {
    const cards = [...document.querySelectorAll(".cards li")];
    const cut = cards.flatMap((card) => [...card.querySelectorAll("*")]).filter((each) => {
        const { overflowX, webkitLineClamp } = getComputedStyle(each);
        const over = each.scrollHeight > each.clientHeight + 1 || each.scrollWidth > each.clientWidth + 1;
        return each.clientWidth > 0 && over && (overflowX !== "visible" || webkitLineClamp !== "none");
    });
    const boxes = cards.map((card) => card.getBoundingClientRect());
    const meet = (a, b) => a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1;
    const overlapping = boxes.some((a, i) => boxes.some((b, k) => i < k && meet(a, b)));
    return [...cut.map(({ outerHTML }) => outerHTML.slice(0, 200)), ...(overlapping ? ["cards overlap"] : [])];
}"""
HOSTILE = '"><img src=x onerror="window.hacked=1"></script><script>window.hacked=1</script>'


@pytest.fixture
def table(service: Service, campaign: str) -> dict[str, Any]:
    """What the service says of all contacts."""
    return dict(service.client.get(f"/v1/campaigns/{campaign}/failure-table?tier=raw").json())


@pytest.fixture
def screen(page_at: Callable[..., Page], campaign: str) -> Callable[..., Page]:
    """The screen with a query, once its cards are there."""

    def opened(query: str = "", **options: object) -> Page:
        page = page_at(f"campaigns/{campaign}/failures{query}", **options)
        expect(page.get_by_role("status").first).to_contain_text(" of ")
        return page

    return opened


def shown(page: Page) -> tuple[int, int]:
    """How many failures there are now, of how many."""
    found = re.match(r"([\d,]+) of ([\d,]+)", page.locator(".found-head p").inner_text())
    assert found
    return int(found[1].replace(",", "")), int(found[2].replace(",", ""))


def wait_for(page: Page, number: int) -> None:
    """Until so many failures are left."""
    expect(page.locator(".found-head p b")).to_have_text(f"{number:,}")


def kinds_of(table: dict[str, Any]) -> list[int]:
    """Returns each kind's shown episode: one of the headline, else the worst."""

    def order(i: int) -> tuple[Any, ...]:
        severity = ["severe", "moderate", None, "minor"].index(table["severity"][i])
        fault = ["ego", "shared", "other", None].index(table["fault"][i])
        grade = ["preventable", "full_braking", "unavoidable", None].index(table["grade"][i])
        implausible = table["plausibility"][i] == "implausible"
        worst = implausible, -table["weight"][i], severity, fault, grade, -(table["relative_speed_mps"][i] or 0)
        return not table["headline"][i], *worst, i

    kinds = {table["kind"][i] for i in valid_of(table)}
    return [min((i for i in valid_of(table) if table["kind"][i] == kind), key=order) for kind in kinds]


def valid_of(table: dict[str, Any]) -> list[int]:
    return [i for i, valid in enumerate(table["valid"]) if valid]


def test_cards_match_the_api(screen: Callable[..., Page], table: dict[str, Any], campaign: str) -> None:
    page = screen("?sort=newest")
    kinds = kinds_of(table)
    assert shown(page) == (len(kinds), len(kinds))
    newest = max(kinds)
    card = page.locator(".cards li").first
    expect(card).to_have_attribute("aria-posinset", "1")
    expect(card).to_have_attribute("aria-setsize", str(len(kinds)))
    link = card.locator("a[data-go]")
    assert link.get_attribute("href") == f"#/campaigns/{campaign}/failures/{table['ids'][newest]}"
    assert link.get_attribute("title") == table["kinds"][table["kind"][newest]]["name"]
    expect(card).to_contain_text(f"{table['relative_speed_mps'][newest]:.1f} m/s")
    expect(card).to_contain_text(table["striker"][newest].replace("_", " "))
    alike = [i for i in valid_of(table) if table["kind"][i] == table["kind"][newest]]
    expect(card.locator("dd").nth(2)).to_have_text(f"{len(alike)} {'episode' if len(alike) == 1 else 'episodes'}")
    for method in {table["methods"][i] for i in alike}:
        expect(card.locator(".found-by")).to_contain_text(method)
    words = {"preventable": "preventable", "full_braking": "by full braking", "unavoidable": "unavoidable"}
    expect(card).to_contain_text(words[table["grade"][newest]])
    expect(card).to_contain_text(f"fault: {table['fault'][newest]}")

    page.get_by_role("combobox", name="Show").select_option("episode")
    wait_for(page, len(valid_of(table)))


def test_a_kind_opens_its_variants(screen: Callable[..., Page], table: dict[str, Any]) -> None:
    page = screen()
    variants: dict[int, set[int]] = {}
    for i in valid_of(table):
        variants.setdefault(table["kind"][i], set()).add(table["variant"][i])
    kind, most = max(variants.items(), key=lambda item: len(item[1]))
    card = page.locator(".cards li", has=page.locator(f'a[data-go][title="{table["kinds"][kind]["name"]}"]'))
    card.get_by_role("link", name=f"{len(most)} variants").click()
    wait_for(page, len(most))
    assert set(page.locator(".cards a[data-go]").evaluate_all("links => links.map(link => link.title)")) == {
        table["kinds"][kind]["name"]
    }


def test_a_card_opens_the_replay_and_back_finds_the_same_place(screen: Callable[..., Page], campaign: str) -> None:
    page = screen("?by=episode&sort=closing", viewport={"width": 1000, "height": 500})
    page.mouse.wheel(0, 600)
    card = page.locator(".cards li a[data-go]").nth(3)
    to = card.get_attribute("href")
    card.click()
    expect(page.locator(".cards")).to_have_count(0)
    assert page.url.endswith(f"{to}")
    page.go_back()
    expect(page.locator(f'.cards a[href="{to}"]')).to_be_in_viewport()
    assert "sort=closing" in page.url


def test_filters_survive_a_reload(screen: Callable[..., Page], table: dict[str, Any]) -> None:
    page = screen()
    page.get_by_role("combobox", name="Show").select_option("episode")
    page.get_by_role("combobox", name="Family").select_option("mixed")
    page.get_by_role("combobox", name="Order").select_option("closing")
    page.get_by_role("combobox", name="Horizontal axis").select_option("scene.friction")
    mixed = [i for i in valid_of(table) if table["families"][i] == "mixed"]
    wait_for(page, len(mixed))
    word = table["kinds"][table["kind"][mixed[0]]]["name"].split(",")[0].split(" ")[0]
    page.get_by_role("searchbox", name="Text").fill(word)
    left = [i for i in mixed if word in table["kinds"][table["kind"][i]]["name"]]
    wait_for(page, len(left))
    expect(page).to_have_url(re.compile(f"q={word}"))
    links = [link.get_attribute("href") for link in page.locator(".cards a[data-go]").all()]
    fastest = max(left, key=lambda i: table["relative_speed_mps"][i])
    assert links[0] is not None
    assert links[0].endswith(table["ids"][fastest])

    page.reload()
    wait_for(page, len(left))
    assert [link.get_attribute("href") for link in page.locator(".cards a[data-go]").all()] == links
    expect(page.get_by_role("combobox", name="Family")).to_have_value("mixed")
    expect(page.get_by_role("combobox", name="Horizontal axis")).to_have_value("scene.friction")

    page.get_by_role("button", name="Reset", exact=True).click()
    wait_for(page, len(valid_of(table)))


def test_failures_are_filtered_by_severity_fault_and_what_drove_them(
    screen: Callable[..., Page], table: dict[str, Any]
) -> None:
    page = screen("?by=episode")
    valid = valid_of(table)
    for facet, column in (("Severity", "severity"), ("Fault", "fault")):
        value = next(table[column][i] for i in valid if table[column][i])
        page.get_by_role("combobox", name=facet).select_option(value)
        wait_for(page, sum(table[column][i] == value for i in valid))
        page.get_by_role("button", name="Reset", exact=True).click()
    driven = table["driven_by"][valid[0]]
    page.get_by_role("combobox", name="Driven by", exact=True).select_option(driven or "unknown")
    wait_for(page, sum(table["driven_by"][i] == driven for i in valid))
    page.get_by_role("button", name="Reset", exact=True).click()
    page.get_by_role("button", name="More filters").click()
    page.get_by_role("combobox", name="Prevented by").select_option("full_braking")
    wait_for(page, sum("full_braking" in table["prevented_by"][i] for i in valid))


def test_ranges_by_numbers_filter(screen: Callable[..., Page], table: dict[str, Any]) -> None:
    page = screen("?by=episode&family=low")
    page.get_by_text("Ranges by numbers").click()
    low = [i for i in valid_of(table) if table["families"][i] == "low"]
    speeds = sorted(table["relative_speed_mps"][i] for i in low)
    least = round(speeds[len(speeds) // 2], 2)
    page.get_by_label("closing speed, m/s: at least").fill(str(least))
    page.get_by_label("closing speed, m/s: at least").press("Enter")
    fast = [i for i in low if table["relative_speed_mps"][i] >= least]
    wait_for(page, len(fast))
    scenes = table["scenes"]["low"]
    column = scenes["names"].index("friction")
    friction = {failure: row[column] for failure, row in zip(scenes["of"], scenes["rows"], strict=True)}
    most = round(sorted(friction[i] for i in fast)[len(fast) // 2], 3)
    page.get_by_label("friction: at most").fill(str(most))
    page.get_by_label("friction: at most").press("Enter")
    both = [i for i in fast if friction[i] <= most]
    wait_for(page, len(both))
    page.reload()
    wait_for(page, len(both))
    page.get_by_role("button", name="Clear the range of friction").click()
    wait_for(page, len(fast))
    page.get_by_role("button", name="Clear all").click()
    wait_for(page, len(low))


def test_dragging_along_an_axis_filters_and_a_click_lets_go(screen: Callable[..., Page], table: dict[str, Any]) -> None:
    page = screen("?by=episode")
    page.locator(".lines").scroll_into_view_if_needed()
    box = page.locator(".lines").bounding_box()
    assert box
    y = box["y"] + 15  # closing speed is the first axis
    page.mouse.move(box["x"] + box["width"] / 2, y)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] - 12, y + 3, steps=4)
    page.mouse.up()
    expect(page).to_have_url(re.compile("brush=closing"))
    brush = re.search(r"brush=closing%3A([\d.]+)%3A([\d.]+)", page.url)
    assert brush
    low, high = map(float, brush.groups())
    wait_for(page, sum(low <= table["relative_speed_mps"][i] <= high for i in valid_of(table)))
    page.locator(".lines").scroll_into_view_if_needed()
    box = page.locator(".lines").bounding_box()  # fewer cards above it have moved it
    assert box
    page.mouse.click(box["x"] + 30, box["y"] + 15)
    wait_for(page, len(valid_of(table)))
    assert "brush" not in page.url


def test_refused_contacts_by_rule(screen: Callable[..., Page], table: dict[str, Any]) -> None:
    page = screen()
    page.get_by_role("link", name="Refused").click()
    refused = [i for i, valid in enumerate(table["valid"]) if not valid]
    wait_for(page, len(refused))
    rules = Counter(rule for i in refused for rule in table["refused_by"][i])
    counts = [int(each) for each in page.locator(".bars b").all_inner_texts()]
    assert counts == sorted(rules.values(), reverse=True)
    page.locator(".bars button").first.click()
    wait_for(page, counts[0])
    expect(page.locator(".bars button").first).to_have_attribute("aria-pressed", "true")
    assert f"rule={max(rules, key=lambda rule: rules[rule])}" in page.url or counts.count(counts[0]) > 1
    page.reload()
    wait_for(page, counts[0])


def note(page: Page, state: str, comment: str) -> None:
    page.locator(".cards li").first.get_by_role("button", name="Triage").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label(state).check()
    dialog.get_by_label("Comment").fill(comment)
    dialog.get_by_role("button", name="Save").click()
    expect(dialog).to_have_count(0)


def test_triage_is_kept_and_seen_by_others(screen: Callable[..., Page]) -> None:
    page = screen("?sort=newest")
    note(page, "Confirmed", f"look at this: {HOSTILE}")
    first = page.locator(".cards li").first
    expect(first.get_by_role("button", name="Triage: Confirmed")).to_be_visible()
    page.get_by_role("button", name="More filters").click()
    page.get_by_role("combobox", name="Triage").select_option("confirmed")
    wait_for(page, 1)
    page.reload()
    wait_for(page, 1)
    for other in (page, screen("?sort=newest")):
        other.get_by_role("button", name="Triage: Confirmed").click()
        dialog = other.get_by_role("dialog")
        expect(dialog.get_by_label("Comment")).to_have_value(f"look at this: {HOSTILE}")
        expect(dialog.get_by_label("Confirmed")).to_be_checked()
        assert other.evaluate("window.hacked") is None
        other.keyboard.press("Escape")
        expect(dialog).to_have_count(0)
    page.get_by_role("button", name="Reset", exact=True).click()
    note(page, "New", "")
    expect(first.get_by_role("button", name="Triage: New")).to_be_visible()


def test_triage_that_is_refused_is_taken_back_and_can_be_sent_again(screen: Callable[..., Page]) -> None:
    page = screen("?sort=newest", allowed=("503",))

    def refuse(route: Route) -> None:
        if route.request.method != "PUT":
            route.fallback()
            return
        problem = {"status": 503, "title": "x", "detail": "The database cannot be written.", "reason": "store"}
        route.fulfill(status=503, content_type="application/problem+json", body=json.dumps(problem))

    page.route("**/triage", refuse)
    place = page.locator(".cards li", has_text="New").first.get_attribute("data-at")
    card = page.locator(f'.cards li[data-at="{place}"]')
    card.get_by_role("button", name="Triage").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("Fixed").check()
    dialog.get_by_label("Comment").fill("kept while refused")
    dialog.get_by_role("button", name="Save").click()
    expect(page.get_by_role("alert")).to_contain_text("The database cannot be written.")
    expect(card).to_contain_text("New")
    expect(dialog.get_by_label("Comment")).to_have_value("kept while refused")
    dialog.get_by_role("button", name="Cancel").click()
    expect(dialog).to_have_count(0)


def test_keys_go_from_card_to_card(screen: Callable[..., Page], table: dict[str, Any]) -> None:
    page = screen("?by=episode")
    last = len(valid_of(table))
    page.locator(".cards a[data-go]").first.focus()
    page.keyboard.press("ArrowRight")
    expect(page.locator('.cards li[aria-posinset="2"] a')).to_be_focused()
    page.keyboard.press("End")
    expect(page.locator(f'.cards li[aria-posinset="{last}"] a')).to_be_focused()
    expect(page.locator(f'.cards li[aria-posinset="{last}"]')).to_be_in_viewport()
    page.keyboard.press("Home")
    expect(page.locator('.cards li[aria-posinset="1"] a')).to_be_focused()


@pytest.mark.parametrize("width", [372, PHONE["width"], 1440])
def test_no_card_cuts_what_it_says(
    new_page: Callable[..., Page], service: Service, campaign: str, table: dict[str, Any], width: int
) -> None:
    page = new_page(viewport={"width": width, "height": 900}, allowed=("404",))
    size = len(table["ids"])
    told = table | {"requirement": ["mine_" + 35 * "x"] * size, "striker": ["a striker with a long name " * 4] * size}
    told["kinds"] = [{**kind, "name": f"{kind['name']}, and all that it did before"} for kind in table["kinds"]]
    page.route("**/failure-table*", lambda route: route.fulfill(json=told))
    page.goto(f"{service.client.base_url}/page/#/campaigns/{campaign}/failures?by=episode")
    wait_for(page, len(valid_of(table)))
    seen: set[str] = set()
    while f"{len(valid_of(table)) - 1}" not in seen:  # only cards near the view are in the document
        page.wait_for_function("() => new Promise((done) => requestAnimationFrame(() => done(true)))")
        seen |= set(page.evaluate(DRAWN))
        assert page.evaluate(CUT) == []
        page.evaluate("scrollBy(0, 500)")


def test_hostile_text_is_shown_and_runs_nothing(
    new_page: Callable[..., Page], service: Service, campaign: str, table: dict[str, Any]
) -> None:
    page = new_page(allowed=("404",))
    size = len(table["ids"])
    hostile = table | {column: [HOSTILE] * size for column in ("striker", "methods", "run_ids")}
    hostile["broke"] = [[HOSTILE]] * size
    hostile["kinds"] = [{**kind, "name": f"{HOSTILE} {n}"} for n, kind in enumerate(table["kinds"])]
    page.route("**/failure-table*", lambda route: route.fulfill(json=hostile))
    page.goto(f"{service.client.base_url}/page/#/campaigns/{campaign}/failures?q=onerror")
    wait_for(page, len(kinds_of(hostile)))
    expect(page.locator(".cards li").first).to_contain_text("<img src=x")
    expect(page.locator(".crumbs")).to_contain_text("<b>7</b>")
    page.locator(".cards li").first.hover()
    expect(page.locator(".tip")).to_contain_text("<img src=x")
    page.get_by_role("link", name="Refused").click()
    expect(page.locator(".cards li").first).to_contain_text("<script>")
    assert page.evaluate("window.hacked") is None


def test_a_screen_of_an_answer_that_it_cannot_draw_says_so(
    new_page: Callable[..., Page], service: Service, campaign: str
) -> None:
    page = new_page(allowed=("404",))
    page.route("**/failure-table*", lambda route: route.fulfill(json={"ids": ["a"]}))  # as of another version
    page.goto(f"{service.client.base_url}/page/#/campaigns/{campaign}/failures")
    expect(page.get_by_role("alert")).to_contain_text("cannot be drawn")
    page.goto(f"{service.client.base_url}/page/#/campaigns/{campaign}")
    expect(page.get_by_role("alert")).to_have_count(0)
