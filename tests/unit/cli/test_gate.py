import argparse
import io
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from typing import Any

import pytest
from rich.console import Console

from risk_sac.cli.campaigns.gate import Bounds, verdict
from risk_sac.cli.campaigns.junit import junit
from risk_sac.cli.campaigns.output import results_tables
from risk_sac.client import Episode, Results, RunResult
from risk_sac.errors import ConfigError
from tests.builders import run_metrics

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
    "signatures": {},
    "conflicts_by_second": [],
    "contacts_by_second": [],
}
FEW = {"episodes": 60, "failures": 3, "ecr": 0.05, "ecr_low": 0.017, "ecr_high": 0.137}
HINT = "\nMore episodes narrow an interval; --judge-by rate ignores it."


def results(state: str, *totals: dict[str, Any]) -> Results:
    complete = state in ("succeeded", "failed", "cancelled")
    found = [TOTAL | total for total in totals]
    return Results.model_validate(
        {"campaign_id": "c1", "state": state, "complete": complete, "runs": [], "totals": found}
    )


NEVER_FAST = {"counts": "failure", "violated": 12, "valid": 12, "distinct": 2, "preventable": 0}
FAST = "never_fast violated; ego goes straight, vehicle near"


def requirements(**rates: tuple[float, float]) -> dict[str, Any]:
    """With these rates and upper ends; `safe_ttc` is reported only."""
    return {
        name: NEVER_FAST
        | {"counts": "report" if name == "safe_ttc" else "failure", "rate": rate, "rate_low": 0.0, "rate_high": high}
        for name, (rate, high) in rates.items()
    }


UNBOUND: dict[str, Any] = {
    "max_ecr": None,
    "max_pcr": None,
    "max_rate": None,
    "max_preventable": None,
    "no_new_failures": None,
    "judge_by": "interval",
}
LEADER, CUT_IN = "leader, ahead; ego brakes late", "cut-in, alongside; ego does not brake"


def by_rate(**bounds: Any) -> Bounds:
    return Bounds(judged_by="rate", **bounds)


def test_a_rate_below_its_bound_is_not_enough_where_its_interval_ends_above():
    status, reason = verdict(results("succeeded", FEW), Bounds(ecr=0.1))
    assert status == 1
    assert reason == (
        "ECR may be above 0.1: low sac 0.050, 95 % interval up to 0.137 (3 valid contacts in 60 episodes)" + HINT
    )
    assert verdict(results("succeeded", FEW), Bounds(ecr=0.14))[0] == 0


def test_the_rate_of_a_requirement_is_judged_in_the_i_i_d_phase_too():
    metrics = run_metrics(40, requirements=requirements(never_fast=(0.3, 0.45)))
    drawn = RunResult(
        **{"id": "low-iid-random-0", "family": "low", "method": "iid-random", "seed": 0, "state": "succeeded"},
        **{"reason": None, "metrics": metrics, "evaluation": None, "spec_digest": "", "digest": None},
        **{"versions": {}, "busy_s": 1.0},
    )
    found = results("succeeded", {"requirements": requirements(never_fast=(0.0, 0.06))})
    found = found.model_copy(update={"runs": [drawn]})
    status, reason = verdict(found, by_rate(requirements={"never_fast": 0.1}))
    assert status == 1
    assert "never_fast above 0.1: low iid-random 0.300 (12 valid violations in 40 episodes)" in reason


@pytest.mark.parametrize(
    ("field", "bounds"),
    [("--max-ecr", {"max_ecr": 0.0}), ("--max-pcr", {"max_pcr": 0.0}), ("--max-rate", {"max_rate": [("a", 0.0)]})],
)
def test_a_bound_that_no_interval_can_keep_is_refused_beforehand(field, bounds):
    options = argparse.Namespace(**UNBOUND | bounds)
    with pytest.raises(ConfigError, match="wanted more, or --judge-by rate") as error:
        Bounds.of(options)
    assert error.value.field == field
    options.judge_by = "rate"
    assert Bounds.of(options)


@pytest.mark.parametrize(("bound", "status"), [(0, 1), (1, 0), (2, 0)])
def test_more_distinct_preventable_failures_than_may_be_are_named(bound, status):
    found, reason = verdict(
        results("succeeded", {}, {"method": "random", "distinct_preventable": 0}), Bounds(preventable=bound)
    )
    assert found == status
    assert ("low sac: 1 distinct preventable failure, where 0 may be" in reason) == bool(status)
    assert "random" not in reason


def test_a_kind_of_failure_is_news_unless_any_method_of_the_earlier_campaign_found_it_in_that_family(tmp_path):
    file = tmp_path / "known.json"
    earlier = results("succeeded", {"signatures": {LEADER: 2}}, {"method": "random", "signatures": {CUT_IN: 1}})
    file.write_text(earlier.model_dump_json())
    bounds = Bounds.of(argparse.Namespace(**UNBOUND | {"no_new_failures": file}))
    assert verdict(results("succeeded", {"signatures": {LEADER: 9, CUT_IN: 1}}), bounds)[0] == 0
    status, reason = verdict(results("succeeded", {"family": "dense", "signatures": {LEADER: 1}}), bounds)
    assert (status, reason) == (1, f"dense sac: a new kind of failure: {LEADER}")
    assert verdict(results("running", {"signatures": {}}), bounds)[0] == 2
    violation = results("succeeded", {"signatures": {LEADER: 1, FAST: 3}})  # without a contact
    assert verdict(violation, bounds) == (1, f"low sac: a new kind of failure: {FAST}")
    file.write_text(violation.model_dump_json())
    assert verdict(violation, Bounds.of(argparse.Namespace(**UNBOUND | {"no_new_failures": file})))[0] == 0


@pytest.mark.parametrize("bounds", [Bounds(), Bounds(ecr=0.5), Bounds(pcr=0.5)])
@pytest.mark.parametrize("state", ["failed", "cancelled"])
def test_a_campaign_that_was_not_measured_to_the_end_could_not_run(state, bounds):
    assert verdict(results(state, {"ecr": 0.9}), bounds)[0] == 2


METRICS = run_metrics(
    40, failures=10, ecr=0.25, ecr_low=0.1, ecr_high=0.4, distinct_failures=4, raw_collisions=12, preventable=6
).model_copy(
    update={"distinct_preventable": 2, "headline_candidates": 1, "pcr": 0.15, "pcr_low": 0.05, "pcr_high": 0.3}
)
RUN = {
    "id": "low-sac-0",
    "family": "low",
    "method": "sac",
    "seed": 0,
    "state": "succeeded",
    "reason": None,
    "metrics": METRICS,
    "evaluation": None,
    "spec_digest": "aa",
    "digest": "bb",
    "versions": {"libsumo": "1.28.0"},
    "busy_s": 12.5,
}
BOUNDS = Bounds(ecr=0.1)
SERVICE = "http://host"
URL = "http://host/v1/campaigns/c1"


def report(
    *runs: dict[str, Any],
    bounds: Bounds = BOUNDS,
    failures: Mapping[str, Sequence[Episode]] | None = None,
    totals: Sequence[dict[str, Any]] = (),
    state: str = "succeeded",
) -> ElementTree.Element:
    results = Results.model_validate(
        {
            "campaign_id": "c1",
            "state": state,
            "complete": state == "succeeded",
            "headline": 2,
            "totals": [TOTAL | total for total in totals],
            "runs": [RUN | run for run in runs],
        }
    )
    written = io.BytesIO()
    junit(results, SERVICE, URL, bounds, failures or {}).write(written, pretty=True)
    return ElementTree.fromstring(written.getvalue())


def test_a_method_above_the_bound_fails_in_a_case_of_its_own_as_the_exit_status_does():
    root = report(
        {}, {"seed": 1, "id": "low-sac-1"}, totals=[{"runs": 2, "ecr": 0.25, "ecr_high": 0.278, "failures": 250}]
    )
    cases = [(case.attrib["classname"], case.attrib["name"]) for case in root.iter("testcase")]
    assert cases == [("low.sac", "seed 0"), ("low.sac", "seed 1"), ("low.sac", "all seeds")]
    (failure,) = root.iter("failure")
    assert failure.attrib["message"] == (
        "ECR above 0.1: 0.250, 95 % interval up to 0.278 (250 valid contacts in 1000 episodes)"
    )


def test_whatever_a_reason_holds_the_report_is_well_formed():
    reason = "".join(map(chr, range(0x180))) + "\ud800\ufffe\uffff\U0001f697 <![CDATA[ ]]> &amp; \"'"
    (error,) = report({"state": "failed", "reason": reason}).iter("error")
    assert "\x1b" not in error.attrib["message"]
    assert error.attrib["message"].endswith("\U0001f697 <![CDATA[ ]]> &amp; \"'")


def test_each_requirement_is_a_row_below_its_family_and_method(capsys):
    own = "keeps_a_distance_of_some_forty_letters_x"
    found = requirements(no_contact=(0.1, 0.2), safe_ttc=(0.3, 0.4), **{own: (0.999, 1.0)})
    totals = [TOTAL | {"requirements": found}, TOTAL | {"method": "random"}]  # the latter from before
    results = {"campaign_id": "c1", "state": "succeeded", "complete": True, "runs": [], "totals": totals}
    bounds = Bounds(requirements={"no_contact": 0.15, "safe_ttc": 0.1})
    Console(width=80).print(results_tables(Results.model_validate(results), bounds))
    printed = capsys.readouterr().out
    assert "…" not in printed
    rows = [row.split() for row in printed[printed.index("low sac") :].splitlines()]
    assert rows[1] == ["no_contact", "failure", "12", "12", "2", "0", "0.100", "[0.000,", "0.200]"]
    assert rows[2] == ["may", "be", "above", "0.15"]
    assert rows[3] == ["safe_ttc", "report", "12", "–", "–", "–", "0.300", "[0.000,", "0.400]"]
    assert rows[4] == ["above", "0.1"]
    assert rows[5][0] + rows[6][0] == own
    assert "low random" not in printed
