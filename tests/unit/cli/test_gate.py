import argparse
from typing import Any

import pytest

from risk_sac.cli.campaigns.gate import GateBounds, verdict
from risk_sac.client import Results
from risk_sac.errors import ConfigError

TOTAL = {
    "family": "low",
    "method": "sac",
    "runs": 1,
    "episodes": 1000,
    "rejected": 0,
    "invalid": 0,
    "environment_steps": 100_000,
    "artefacts": 0,
    "unresponsive_share": None,
    "raw_collisions": 120,
    "failures": 100,
    "ecr": 0.1,
    "ecr_low": 0.083,
    "ecr_high": 0.12,
    "efficiency": 0.0,
    "cost_rate": 0.0,
    "dispersion": None,
    "distinct_failures": 3,
    "steps_per_distinct_failure": None,
    "preventable": 40,
    "distinct_preventable": 1,
    "pcr": 0.04,
    "pcr_low": 0.03,
    "pcr_high": 0.054,
    "unresponsive": 0,
    "kinds": {},
    "conflicts_by_second": [],
    "contacts_by_second": [],
}
FEW = {"episodes": 60, "collisions": 3, "failures": 3, "ecr": 0.05, "ecr_low": 0.017, "ecr_high": 0.137}
HINT = "\nMore episodes narrow an interval; --judge-by rate ignores it."


def results(state: str, *totals: dict[str, Any]) -> Results:
    complete = state in ("succeeded", "failed", "cancelled")
    found = [TOTAL | total for total in totals]
    return Results.model_validate(
        {"campaign_id": "c1", "state": state, "complete": complete, "runs": [], "totals": found}
    )


FAST = "never_fast violated; ego goes straight, vehicle near"


UNBOUND: dict[str, Any] = {
    "max_ecr": None,
    "max_pcr": None,
    "max_rate": None,
    "max_preventable": None,
    "no_new_failures": None,
    "judge_by": "interval",
}
LEADER, CUT_IN = "leader, ahead; ego brakes late", "cut-in, alongside; ego does not brake"


def test_a_rate_below_its_bound_is_not_enough_where_its_interval_ends_above():
    status, reason = verdict(results("succeeded", FEW), GateBounds(ecr=0.1))
    assert status == 1
    assert reason == (
        "ECR may be above 0.1: low sac 0.050, 95 % interval up to 0.137 (3 valid contacts in 60 episodes)" + HINT
    )
    assert verdict(results("succeeded", FEW), GateBounds(ecr=0.14))[0] == 0


@pytest.mark.parametrize(
    ("field", "bounds"),
    [("--max-ecr", {"max_ecr": 0.0}), ("--max-pcr", {"max_pcr": 0.0}), ("--max-rate", {"max_rate": [("a", 0.0)]})],
)
def test_a_bound_that_no_interval_can_keep_is_refused_beforehand(field, bounds):
    options = argparse.Namespace(**UNBOUND | bounds)
    with pytest.raises(ConfigError, match="wanted more, or --judge-by rate") as error:
        GateBounds.of(options)
    assert error.value.field == field
    options.judge_by = "rate"
    assert GateBounds.of(options)


@pytest.mark.parametrize(("bound", "status"), [(0, 1), (1, 0), (2, 0)])
def test_more_distinct_preventable_failures_than_may_be_are_named(bound, status):
    found, reason = verdict(
        results("succeeded", {}, {"method": "random", "distinct_preventable": 0}), GateBounds(preventable=bound)
    )
    assert found == status
    assert ("low sac: 1 distinct preventable failure, where 0 may be" in reason) == bool(status)
    assert "random" not in reason


def test_a_kind_of_failure_is_news_unless_any_method_of_the_earlier_campaign_found_it_in_that_family(tmp_path):
    file = tmp_path / "known.json"
    earlier = results("succeeded", {"kinds": {LEADER: 2}}, {"method": "random", "kinds": {CUT_IN: 1}})
    file.write_text(earlier.model_dump_json())
    bounds = GateBounds.of(argparse.Namespace(**UNBOUND | {"no_new_failures": file}))
    assert verdict(results("succeeded", {"kinds": {LEADER: 9, CUT_IN: 1}}), bounds)[0] == 0
    status, reason = verdict(results("succeeded", {"family": "dense", "kinds": {LEADER: 1}}), bounds)
    assert (status, reason) == (1, f"dense sac: a new kind of failure: {LEADER}")
    assert verdict(results("running", {"kinds": {}}), bounds)[0] == 2
    violation = results("succeeded", {"kinds": {LEADER: 1, FAST: 3}})  # without a contact
    assert verdict(violation, bounds) == (1, f"low sac: a new kind of failure: {FAST}")
    file.write_text(violation.model_dump_json())
    assert verdict(violation, GateBounds.of(argparse.Namespace(**UNBOUND | {"no_new_failures": file})))[0] == 0


@pytest.mark.parametrize("bounds", [GateBounds(), GateBounds(ecr=0.5), GateBounds(pcr=0.5)])
@pytest.mark.parametrize("state", ["failed", "cancelled"])
def test_a_campaign_that_was_not_measured_to_the_end_could_not_run(state, bounds):
    assert verdict(results(state, {"ecr": 0.9}), bounds)[0] == 2
