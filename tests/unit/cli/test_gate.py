import argparse
from typing import Any

import pytest

from risk_sac.cli.campaigns.gate import Bounds, rate, verdict
from risk_sac.client import Results

TOTAL = {
    "family": "low",
    "method": "sac",
    "runs": 1,
    "episodes": 100,
    "raw_collisions": 12,
    "failures": 10,
    "ecr": 0.1,
    "ecr_low": 0.05,
    "ecr_high": 0.18,
    "efficiency": 0.0,
    "cost_rate": 0.0,
    "dispersion": None,
    "distinct_failures": 3,
    "steps_per_distinct_failure": None,
    "preventable": 4,
    "distinct_preventable": 1,
    "pcr": 0.04,
    "pcr_low": 0.01,
    "pcr_high": 0.1,
    "unresponsive": 0,
    "signatures": {},
    "conflicts_by_second": [],
    "contacts_by_second": [],
}


def results(state: str, *totals: dict[str, Any]) -> Results:
    complete = state in ("succeeded", "failed", "cancelled")
    found = [TOTAL | total for total in totals]
    return Results.model_validate(
        {"campaign_id": "c1", "state": state, "complete": complete, "runs": [], "totals": found}
    )


def test_without_a_bound_any_number_of_failures_is_fine() -> None:
    assert verdict(results("succeeded", {"ecr": 1.0}), Bounds()) == (0, "")


def test_an_ecr_above_the_bound_is_named() -> None:
    found = results("succeeded", {"ecr": 0.05}, {"method": "random", "ecr": 0.2})
    assert verdict(found, Bounds(ecr=0.1)) == (1, "ECR above 0.1: low random 0.200")


def test_a_pcr_above_its_bound_is_named_whatever_the_ecr() -> None:
    found = results("succeeded", {"ecr": 0.9, "pcr": 0.1}, {"method": "random", "ecr": 0.2, "pcr": 0.2})
    assert verdict(found, Bounds(pcr=0.1)) == (1, "PCR above 0.1: low random 0.200")
    assert verdict(found, Bounds(pcr=0.2)) == (0, "")
    both = verdict(found, Bounds(ecr=0.5, pcr=0.05))
    assert both == (1, "ECR above 0.5: low sac 0.900; PCR above 0.05: low sac 0.100, low random 0.200")


def test_an_ecr_at_the_bound_is_fine_and_its_interval_is_not_looked_at() -> None:
    assert verdict(results("succeeded", {"ecr": 0.1, "ecr_high": 0.9}), Bounds(ecr=0.1))[0] == 0
    assert verdict(results("succeeded", {"ecr": 0.11, "ecr_low": 0.0}), Bounds(ecr=0.1))[0] == 1


def test_controls_count_like_any_other_method() -> None:
    assert verdict(results("succeeded", {"method": "no-adversary", "ecr": 0.01}), Bounds(ecr=0.0))[0] == 1


@pytest.mark.parametrize("bounds", [Bounds(), Bounds(ecr=0.5), Bounds(pcr=0.5)])
@pytest.mark.parametrize("state", ["failed", "cancelled"])
def test_a_campaign_that_was_not_measured_to_the_end_could_not_run(state: str, bounds: Bounds) -> None:
    assert verdict(results(state, {"ecr": 0.9}), bounds)[0] == 2


def test_a_campaign_that_goes_on_cannot_be_judged_yet() -> None:
    assert verdict(results("running", {"ecr": 0.0}), Bounds(ecr=0.5))[0] == 2
    assert verdict(results("running", {"ecr": 0.0}), Bounds(pcr=0.5))[0] == 2
    assert verdict(results("running", {"ecr": 0.0}), Bounds())[0] == 0


def test_a_method_without_an_episode_is_not_above() -> None:
    assert verdict(results("succeeded", {"ecr": None, "pcr": None}), Bounds(ecr=0.0, pcr=0.0))[0] == 0


@pytest.mark.parametrize("text", ["-0.1", "1.1", "nan", "inf"])
def test_a_bound_is_a_rate(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="wanted a rate"):
        rate(text)
