import io
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from typing import Any

from risk_sac.cli.campaigns.gate import Bounds
from risk_sac.cli.campaigns.junit import junit
from risk_sac.client import Episode, Results
from risk_sac.records import Grade, Outcome
from tests.builders import collision, episode_record, judgement, run_metrics, violation
from tests.unit.cli.test_gate import TOTAL, requirements

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
FAILURES = {
    "low-sac-0": [
        Episode(
            **dict(
                episode_record(
                    index,
                    Outcome.FAILURE,
                    steps=50,
                    collision=collision(
                        time_s=2.0,
                        other_id="left",
                        ego_speed_mps=8.0,
                        other_speed_mps=1.0,
                        judgement=judgement(broke=(), signature="cut-in, ahead, in a lane; ego goes straight, brakes"),
                    ),
                )
            ),
            id=f"low-sac-0-search-{index}",
            run_id="low-sac-0",
            wall_s=1.0,
        )
        for index in (3, 9)
    ]
}


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


def test_every_family_is_a_suite_and_every_run_a_case() -> None:
    root = report({}, {"family": "dense", "method": "random", "seed": 7, "id": "dense-random-7"}, {"seed": 1})
    assert [suite.attrib["name"] for suite in root] == ["low", "dense"]
    cases = [(case.attrib["classname"], case.attrib["name"]) for case in root.iter("testcase")]
    assert cases == [("low.sac", "seed 0"), ("low.sac", "seed 1"), ("dense.random", "seed 7")]
    assert root[0].find("testcase").attrib["time"] == "12.5"  # type: ignore[union-attr]
    assert {name: root.attrib[name] for name in ("tests", "failures", "errors")} == {
        "tests": "3",
        "failures": "0",
        "errors": "0",
    }


def test_a_method_above_the_bound_fails_in_a_case_of_its_own_as_the_exit_status_does() -> None:
    root = report(
        {}, {"seed": 1, "id": "low-sac-1"}, totals=[{"runs": 2, "ecr": 0.25, "ecr_high": 0.278, "failures": 250}]
    )
    cases = [(case.attrib["classname"], case.attrib["name"]) for case in root.iter("testcase")]
    assert cases == [("low.sac", "seed 0"), ("low.sac", "seed 1"), ("low.sac", "all seeds")]
    (failure,) = root.iter("failure")
    assert failure.attrib["message"] == (
        "ECR above 0.1: 0.250, 95 % interval up to 0.278 (250 valid contacts in 1000 episodes)"
    )


def test_a_requirement_over_its_bound_fails_and_names_the_failures_that_violate_it() -> None:
    both = requirements(no_contact=(0.0, 0.06), never_fast=(0.2, 0.32))
    bounds = Bounds(requirements={"never_fast": 0.1, "no_contact": 0.1})
    broken = FAILURES["low-sac-0"][0].model_copy(update={"id": "low-sac-0-search-5", "collision": None})
    broken = broken.model_copy(update={"violations": (violation(requirement="never_fast", grade=Grade.PREVENTABLE),)})
    found = {"low-sac-0": [*FAILURES["low-sac-0"], broken]}
    root = report({}, bounds=bounds, totals=[{"episodes": 60, "requirements": both}], failures=found)
    (failure,) = root.iter("failure")
    assert failure.attrib["message"].startswith("never_fast above 0.1: 0.200, 95 % interval up to 0.320")
    assert (failure.text or "").splitlines() == [
        "low-sac-0-search-5: never_fast violated; straight; grade preventable",
        "  risk-sac campaigns failures show c1 low-sac-0-search-5 --url http://host",
        "All: risk-sac campaigns failures list c1 --requirement never_fast --url http://host",
    ]
    assert [case.attrib["name"] for case in root.iter("testcase")] == ["seed 0", "no_contact", "never_fast"]


def test_a_run_that_failed_or_was_cancelled_is_an_error_and_one_that_goes_on_is_skipped() -> None:
    root = report(
        {"state": "failed", "reason": "the policy is NaN"},
        {"state": "cancelled"},
        {"state": "running"},
        {"state": "queued", "metrics": None},
        totals=[{"ecr": 0.9}],
        state="running",
    )
    assert [error.attrib["message"] for error in root.iter("error")] == ["failed: the policy is NaN", "cancelled"]
    assert len(list(root.iter("skipped"))) == 3  # and the judgement of the method
    assert not list(root.iter("failure"))


def test_whatever_a_reason_holds_the_report_is_well_formed() -> None:
    reason = "".join(map(chr, range(0x180))) + "\ud800\ufffe\uffff\U0001f697 <![CDATA[ ]]> &amp; \"'"
    (error,) = report({"state": "failed", "reason": reason}).iter("error")
    assert "\x1b" not in error.attrib["message"]
    assert error.attrib["message"].endswith("\U0001f697 <![CDATA[ ]]> &amp; \"'")
