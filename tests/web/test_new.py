"""Form of a new campaign: sends what it shows, faults by field."""

import json
import re
import shlex
from collections.abc import Callable
from typing import Any

import yaml
from playwright.sync_api import Locator, Page, Request, Route, expect

from risk_sac.config import CampaignSpec
from tests.server import Service
from tests.web.conftest import UNROUNDED

PROFILES = ("default", "perfect", "careful", "defensive")
HOSTILE = "</pre><script>alert('1')</script> yes: \"no\" #\\ \u2028"


def source(page: Page, form: str) -> str:
    """What the page shows as curl or as YAML."""
    page.get_by_role("button", name=form, exact=True).click()
    return str(page.get_by_role("region", name=f"The campaign as {form}").inner_text())


def curl_body(page: Page) -> dict[str, Any]:
    words = shlex.split(source(page, "curl"))
    assert words[:2] == ["curl", page.url.split("/page/")[0] + "/v1/campaigns"]
    body: dict[str, Any] = json.loads(words[words.index("-d") + 1])
    return body


def opened(page: Page, title: str) -> Locator:
    group = page.locator(f"details.group:has(> summary > .group-title:text-is('{title}'))")
    group.locator("summary").first.press("Enter")  # a click can miss while the page still moves
    return group


def more(page: Page) -> None:
    """Opens what the three choices leave."""
    page.locator(".more-settings > summary").press("Enter")


def small(page: Page, label: str = "", episodes: int = 3) -> None:
    """Fills in a few episodes of random search."""
    more(page)
    page.get_by_label("Label", exact=True).fill(label)
    page.get_by_role("checkbox", name="random", exact=True).check()  # first: no method at all is wrong
    for method in ("risk-sac-diverse", "archive"):
        page.get_by_role("checkbox", name=method, exact=True).uncheck()
    page.get_by_label("Episodes", exact=True).fill(str(episodes))


def test_what_is_shown_is_what_is_sent_and_what_the_api_then_has(
    page_at: Callable[..., Page], service: Service
) -> None:
    page = page_at("new")
    small(page, HOSTILE)
    wanted = {"label": HOSTILE, "families": ["mixed"], "methods": ["random"], "budget": {"episodes": 3}}
    assert curl_body(page) == wanted  # and nothing that is the default anyway
    assert yaml.safe_load(source(page, "YAML")) == wanted
    shown = shlex.split(source(page, "curl"))[-1]
    with page.expect_request(lambda each: each.method == "POST" and each.url.endswith("/v1/campaigns")) as sent:
        page.get_by_role("button", name="Start the campaign").click()
    request: Request = sent.value
    assert request.post_data == shown
    assert re.fullmatch("[0-9a-f]{32}", request.headers["idempotency-key"])
    expect(page).to_have_url(re.compile("#/campaigns/c[0-9a-f]+$"))
    stored = service.get(page.url.rsplit("/", 1)[1])
    assert CampaignSpec.model_validate_json(json.dumps(stored["spec"])) == CampaignSpec.model_validate_json(shown)
    assert page.locator("main script").count() == 0


def test_an_answer_that_was_lost_starts_no_second_campaign(page_at: Callable[..., Page], service: Service) -> None:
    page = page_at("new", allowed=("ERR_", "Failed to load"))
    small(page, "only one")

    def lose(route: Route) -> None:
        route.fetch()
        route.abort()

    page.route("**/v1/campaigns", lose, times=1)
    page.get_by_role("button", name="Start the campaign").click()
    expect(page.get_by_text("Trying again cannot start it twice.")).to_be_visible()
    page.get_by_role("button", name="Start the campaign").click()
    expect(page).to_have_url(re.compile("#/campaigns/c[0-9a-f]+$"))
    assert len(service.client.get("/v1/campaigns", params={"label": "only one"}).json()["items"]) == 1


def test_a_refusal_stands_beside_its_field(page_at: Callable[..., Page], service: Service) -> None:
    page = page_at("new", allowed=("422",))
    before = len(service.client.get("/v1/campaigns").json()["items"])
    more(page)
    page.get_by_label("Episodes", exact=True).fill("0")
    page.get_by_role("checkbox", name="mixed", exact=True).uncheck()
    page.get_by_role("button", name="Start the campaign").click()
    episodes = page.locator(".field", has=page.get_by_label("Episodes", exact=True))
    expect(episodes.get_by_role("alert")).to_contain_text("greater than or equal to 1")
    expect(page.get_by_label("Episodes", exact=True)).to_have_attribute("aria-invalid", "true")
    expect(page.get_by_role("group", name="Scenarios").get_by_role("alert")).to_contain_text("at least 1 item")
    page.get_by_role("button", name="budget.episodes").click()
    expect(page.get_by_label("Episodes", exact=True)).to_be_focused()
    page.get_by_label("Episodes", exact=True).fill("3")
    page.get_by_role("checkbox", name="mixed", exact=True).check()
    expect(page.locator(".is-wrong")).to_have_count(0)
    assert len(service.client.get("/v1/campaigns").json()["items"]) == before


def test_a_wrong_value_opens_the_group_that_hides_it(page_at: Callable[..., Page]) -> None:
    page = page_at("new", allowed=("422",))
    more(page)
    learner = opened(page, "Learner")
    agent = opened(page, "Agent")
    agent.get_by_label("Batch size").fill("0")
    expect(agent.get_by_role("alert")).to_contain_text("greater than or equal to 1")
    expect(learner.locator("summary").first).to_contain_text("1 wrong")
    learner.get_by_role("button", name="Back to the defaults").first.click()
    expect(page.locator(".is-wrong")).to_have_count(0)


def test_a_formula_is_checked_while_it_is_written_and_the_fault_has_a_caret(page_at: Callable[..., Page]) -> None:
    page = page_at("new", allowed=("422",))
    more(page)
    opened(page, "Requirements")
    page.get_by_role("button", name="Add a requirement").click()
    formula = page.get_by_label("Formula")
    formula.fill("ttc_s >== 3")
    expect(page.locator(".fault pre")).to_have_text("ttc_s >== 3\n        ^")
    expect(page.locator(".fault")).to_contain_text("Column 8: '=' is not supported")
    expect(formula).to_have_attribute("aria-invalid", "true")
    formula.fill("")
    page.get_by_role("button", name="rss_margin").click()
    expect(formula).to_be_focused()
    page.keyboard.type(" >= 1")
    expect(formula).to_have_value("rss_margin >= 1")
    expect(page.get_by_role("status").filter(has_text="The service would take it")).to_be_visible()
    expect(page.locator(".fault")).to_have_count(0)
    assert curl_body(page)["requirements"] == [{"name": "mine_1", "formula": "rss_margin >= 1"}]


def test_what_an_earlier_campaign_set_deep_down_is_cloned_too(page_at: Callable[..., Page], service: Service) -> None:
    given = {
        "label": "deep",
        "families": ["low"],
        "methods": ["random"],
        "seeds": [3, 4, 5],
        "budget": {"episodes": 1, "cpu_s": 50.5},
        "ego": {"profile": "careful", "sensor": {"range_m": 60.0}},
        "odd": {"environment": {"friction": {"low": 0.7, "high": 0.9}}},
        "requirements": [{"name": "mine", "formula": "ttc_s >= 1", "scale": 2.0, "shapes": False}],
        "learner": {"agent": {"hidden_sizes": [32, 32], "actor_learning_rate": 1e-7}},
    }
    posted = service.post(**given)
    page = page_at(f"new?from={posted}")
    page.get_by_role("region", name="The campaign as curl").wait_for()
    assert curl_body(page) == given
    assert yaml.safe_load(source(page, "YAML")) == given
    expect(page.get_by_label("Seeds")).to_have_value("3-5")
    service.client.post(f"/v1/campaigns/{posted}/cancel")


def test_a_range_of_the_odd_is_moved_by_keys_and_by_numbers(page_at: Callable[..., Page], service: Service) -> None:
    page = page_at("new?scenario=low")
    more(page)
    odd = opened(page, "Operational design domain")
    friction = service.client.get("/v1/families").json()["items"][0]["odd"]["environment"]["friction"]
    low = odd.get_by_role("spinbutton", name="Friction, lowest")
    expect(low).to_have_value(str(friction["low"]))
    odd.get_by_role("slider", name="Friction, lowest").focus()
    for _ in range(4):
        page.keyboard.press("ArrowRight")
    expect(low).to_have_value("0.64")
    odd.get_by_role("spinbutton", name="Friction, highest").fill("0.5")
    page.keyboard.press("Tab")
    expect(odd.get_by_role("spinbutton", name="Friction, highest")).to_have_value("0.64")
    assert curl_body(page)["odd"] == {"environment": {"friction": {"low": 0.64, "high": 0.64}}}  # they meet
    expect(page.get_by_text("Narrows friction")).to_be_visible()
    odd.get_by_role("button", name="As the family has it").click()
    assert "odd" not in curl_body(page)


def test_what_a_family_does_not_support_is_said_before_the_campaign_starts(page_at: Callable[..., Page]) -> None:
    page = page_at("new")
    more(page)
    odd = opened(page, "Operational design domain")
    page.get_by_role("checkbox", name="low", exact=True).check()
    odd.get_by_label("night", exact=True).check()
    assert curl_body(page)["odd"] == {"environment": {"time_of_day": ["day", "night"]}}
    expect(page.locator(".adjustments")).to_contain_text("odd.environment.time_of_day low: asked for {day, night}")
    odd.get_by_label("night", exact=True).uncheck()
    expect(page.locator(".adjustments")).to_have_count(0)


def test_an_ego_is_chosen_by_name_with_known_faults(page_at: Callable[..., Page], service: Service) -> None:
    known = service.client.get("/v1/egos").json()
    page = page_at("new")
    small(page, "with a fault")
    driver = page.get_by_label("Driver", exact=True)
    names = [each["name"] for each in known["items"]]
    expect(driver.locator("optgroup option")).to_have_text(
        [*filter(PROFILES.__contains__, names), *(each for each in names if each not in PROFILES)]
    )
    expect(page.locator("#field-ego\\.profile-help")).to_have_text(known["items"][names.index("default")]["summary"])
    driver.select_option("idm-aeb")
    opened(page, "Defects")
    offered = {each["name"]: each["sentence"] for each in known["defects"] if each["kind"] != "sumo"}
    cards = page.get_by_role("group", name="Defects").locator(".choice-card")
    expect(cards.locator("b")).to_have_text([*offered])
    expect(cards.filter(has_text="weak-brakes")).to_contain_text(offered["weak-brakes"])
    page.get_by_role("checkbox", name="weak-brakes", exact=True).check()
    assert curl_body(page)["ego"] == {"driver": "idm-aeb", "defects": ["weak-brakes"]}
    page.get_by_role("button", name="Start the campaign").click()
    expect(page).to_have_url(re.compile("#/campaigns/c[0-9a-f]+$"))
    expect(page.locator(".posted")).to_contain_text("idm-aeb + weak-brakes")
    page.get_by_role("link", name="Clone").click()
    expect(page.get_by_label("Driver", exact=True)).to_have_value("driver idm-aeb")
    page.get_by_label("Driver", exact=True).select_option("careful")
    assert curl_body(page)["ego"] == {"profile": "careful"}, "nothing of the other driver is left"


def test_an_ego_of_ones_own_is_named_and_refused_beside_the_name(page_at: Callable[..., Page]) -> None:
    page = page_at("new", allowed=("422",))
    page.get_by_label("Driver", exact=True).select_option("another, by its name")
    page.get_by_label("Name of the ego").fill("my-planner")
    assert curl_body(page)["ego"] == {"driver": "my-planner"}
    field = page.locator(".field", has=page.get_by_label("Name of the ego"))
    expect(field.get_by_role("alert")).to_contain_text("my-planner")
    page.get_by_label("Name of the ego").fill("rss")
    expect(page.get_by_text("The service would take it")).to_be_visible()


def test_numbers_have_as_many_digits_as_help(page_at: Callable[..., Page]) -> None:
    page = page_at("new")
    more(page)
    for title in ("Delay and sight", "Operational design domain", "Requirements", "Learner"):
        opened(page, title)
    angle = page.get_by_label("Field of view")
    expect(angle).to_have_value("6.283")
    expect(page.locator(".field", has=angle)).to_contain_text("0.01 to 6.283.")
    assert page.evaluate(UNROUNDED) == []
    assert "ego" not in curl_body(page)
    angle.fill("3.141592653589")
    expect(angle).to_have_value("3.141592653589")
    assert curl_body(page)["ego"] == {"sensor": {"field_of_view_rad": 3.141592653589}}


def test_each_effort_says_what_it_costs_and_follows_the_scenarios(page_at: Callable[..., Page]) -> None:
    page = page_at("new")
    hour = page.get_by_role("button", name="An hour")
    hour.click()
    alone = curl_body(page)
    for scenario in ("low", "dense", "cyclist_ahead", "child_between_cars"):
        page.get_by_role("checkbox", name=scenario).check()
    expect(hour).to_have_attribute("aria-pressed", "true")
    chosen = curl_body(page)
    assert chosen["methods"] == ["risk-sac-diverse", "archive"]
    assert len(chosen["families"]) == 5
    assert chosen["budget"]["episodes"] < alone["budget"]["episodes"]
    episodes = 5 * 2 * len(chosen["seeds"]) * chosen["budget"]["episodes"]
    expect(hour).to_contain_text(f"{episodes:,} episodes, about")
    expect(hour).to_contain_text(re.compile("known defects|not measured"))
    page.get_by_label("Search scenarios").fill("roundabout")
    page.locator(".choice-card", has_text="roundabout_entry").locator("img").wait_for()
