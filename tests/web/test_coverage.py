"""Coverage matrix: cells with states, and the details of a chosen one."""

from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from risk_sac.records import wire
from risk_sac.records.assessment import CellPower, CellState, CoverageMatrix, CoveredCampaign, CoveredPair
from risk_sac.report.matrix import merged
from tests.server import Service
from tests.web.conftest import PHONE

NIGHT = CoveredCampaign(
    id="c1", label="night", ego="idm-aeb", families=("low",), episodes=40, failures=3, complete=True
)
PLAIN = NIGHT.model_copy(update={"id": "c2", "label": "", "failures": 0, "complete": False})
POWER = CellPower(campaign="c2", method="archive", expected=14.0, faults=20)
PAIR = CoveredPair(
    family="low",
    parameters=("lead_gap_m", "ego_speed_mps"),
    bins=(("10 – 20", "20 – 30"), ("5 – 10", "10 – 15")),
    played=((4, 0), (3, 2)),
    failed=((2, 0), (0, 1)),
    campaigns=("c1",),
)


def matrix() -> CoverageMatrix:
    """Matrix of two campaigns: one failed in the ego's first body."""
    empty = merged([])
    behind = {"families": ("low",), "campaigns": ("c1", "c2")}
    groups = []
    for group in empty.groups:
        if group.name == "bodies":
            ego, *others = group.rows
            failed, played, *never = ego.cells
            cells = (
                failed.model_copy(
                    update=behind
                    | {
                        "state": CellState.FAILED,
                        "played": 80,
                        "failed": 3,
                        "failing": ("c1",),
                        "note": "3 of 80 failed",
                    }
                ),
                played.model_copy(
                    update=behind
                    | {
                        "state": CellState.PLAYED,
                        "played": 12,
                        "power": POWER,
                        "note": "played, no failure, power: finds 14 of 20 known faults",
                    }
                ),
                *never,
            )
            group = group.model_copy(update={"rows": (ego.model_copy(update={"cells": cells}), *others)})
        groups.append(group)
    states = [cell.state for group in groups for row in group.rows for cell in row.cells]
    changes = {
        "definitions": (10,),
        "campaigns": (NIGHT, PLAIN),
        "groups": tuple(groups),
        "pairs": (PAIR,),
        "cells": {state: states.count(state) for state in CellState},
    }
    return empty.model_copy(update=changes)


MATRIX = matrix()
FAILED, PLAYED, *_ = next(group for group in MATRIX.groups if group.name == "bodies").rows[0].cells


@pytest.fixture
def page(new_page: Callable[..., Page], service: Service) -> Callable[..., Page]:
    """Opens a project's coverage, with the service's answer replaced by `MATRIX`."""

    def answer(route: Route) -> None:
        route.fulfill(body=wire(MATRIX), content_type="application/json")

    def open_at(query: str = "", **options: Any) -> Page:
        page = new_page(**options)
        page.route("**/v1/coverage*", answer)
        page.goto(f"{service.client.base_url}/page/#/coverage{query}")
        expect(page.locator("section[data-group='bodies']")).to_be_visible()
        return page

    return open_at


def test_a_cell_tells_the_campaigns_behind_it_and_its_power(page: Callable[..., Page]) -> None:
    bodies = page().locator("section[data-group='bodies']")
    expect(bodies.locator(".chip.cell-failed")).to_have_count(1)
    bodies.locator(".chip.cell-failed").click()
    behind = bodies.get_by_role("list", name="Campaigns behind it")
    expect(behind.get_by_role("link", name="night")).to_have_attribute("href", "#/campaigns/c1")
    expect(behind.get_by_role("link", name="failures")).to_have_attribute("href", "#/campaigns/c1/failures")
    expect(behind.get_by_role("link", name="c2", exact=True)).to_have_attribute("href", "#/campaigns/c2")
    bodies.locator(".chip.cell-played").click()
    expect(bodies.get_by_role("status").first).to_contain_text(PLAYED.note)
    expect(bodies.locator(".chip[aria-expanded='true']")).to_have_count(1)


def test_one_state_alone_can_be_shown(page: Callable[..., Page]) -> None:
    shown = page()
    states = shown.get_by_role("group", name="Cells by state").get_by_role("button")
    counts = [int(button.locator("b").inner_text().replace(",", "")) for button in states.all()]
    assert counts == [MATRIX.cells[state] for state in CellState]
    for button, state in zip(states.all(), CellState, strict=True):
        button.click()
        expect(shown.locator(f".chip:not(.cell-{state})")).to_have_count(0)
        expect(shown.locator(f".chip.cell-{state}")).to_have_count(MATRIX.cells[state])
    assert shown.url.endswith("state=inexpressible")


def test_two_parameters_are_shown_together(page: Callable[..., Page]) -> None:
    cells = page().get_by_role("region", name="Coverage of two parameters").locator("td")
    expect(cells).to_have_text(["2 of 4", "–", "0 of 3", "1 of 2"])


def test_the_matrix_is_accessible_and_fits(page: Callable[..., Page], check_fits: Callable[[Page], None]) -> None:
    shown = page(viewport=PHONE)
    shown.locator(".chip.cell-failed").click()
    check_fits(shown)


def test_the_services_matrix_is_shown(page_at: Callable[..., Page], campaign: str) -> None:
    shown = page_at(f"campaigns/{campaign}/coverage")
    expect(shown.locator("section[data-group]")).to_have_count(len(MATRIX.groups))
    expect(shown.locator("section[data-group='parameters'] .chip.cell-failed").first).to_be_visible()
