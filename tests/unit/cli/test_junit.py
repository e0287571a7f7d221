import io
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from typing import Any

from risk_sac.cli.campaigns.gate import Bounds
from risk_sac.cli.campaigns.junit import junit
from risk_sac.client import Results

METRICS = {
    "episodes": 40,
    "failures": 10,
    "ecr": 0.25,
    "ecr_low": 0.1,
    "ecr_high": 0.4,
    "distinct_failures": 4,
    "raw_collisions": 12,
    "preventable": 6,
    "distinct_preventable": 2,
    "pcr": 0.15,
    "pcr_low": 0.05,
    "pcr_high": 0.3,
    "unresponsive": 0,
}
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
URL = "http://host/v1/campaigns/c1"


def report(
    *runs: dict[str, Any], bounds: Bounds = BOUNDS, failures: Mapping[str, Sequence[str]] | None = None
) -> ElementTree.Element:
    results = Results.model_validate(
        {
            "campaign_id": "c1",
            "state": "running",
            "complete": False,
            "totals": [],
            "runs": [RUN | run for run in runs],
        }
    )
    written = io.BytesIO()
    junit(results, URL, bounds, failures or {}).write(written, pretty=True)
    return ElementTree.fromstring(written.getvalue())


def properties(element: ElementTree.Element) -> dict[str, str]:
    return {each.attrib["name"]: each.attrib["value"] for each in element.findall("./properties/property")}


def test_every_family_is_a_suite_and_every_run_a_case() -> None:
    root = report({}, {"family": "dense", "method": "random", "seed": 7, "id": "dense-random-7"}, {"seed": 1})
    assert [suite.attrib["name"] for suite in root] == ["low", "dense"]
    cases = [(case.attrib["classname"], case.attrib["name"]) for case in root.iter("testcase")]
    assert cases == [("low.sac", "seed 0"), ("low.sac", "seed 1"), ("dense.random", "seed 7")]
    assert root[0].find("testcase").attrib["time"] == "12.5"  # type: ignore[union-attr]
    assert {name: root.attrib[name] for name in ("tests", "failures", "errors")} == {
        "tests": "3",
        "failures": "3",
        "errors": "0",
    }


def test_a_run_above_the_bound_fails_and_names_its_first_failures() -> None:
    (failure,) = report({}, failures={"low-sac-0": ["low-sac-0-train-3", "low-sac-0-train-9"]}).iter("failure")
    assert failure.attrib["message"] == "ECR 0.250 > 0.1: 10 valid failures in 40 episodes"
    assert failure.text == f"{URL}/failures/low-sac-0-train-3\n{URL}/failures/low-sac-0-train-9"


def test_a_run_above_the_bound_on_preventable_failures_says_so() -> None:
    (failure,) = report({}, bounds=Bounds(ecr=0.5, pcr=0.1)).iter("failure")
    assert (failure.attrib["type"], failure.attrib["message"]) == (
        "pcr",
        "PCR 0.150 > 0.1: 6 preventable failures in 40 episodes",
    )
    (both,) = report({}, bounds=Bounds(ecr=0.2, pcr=0.1)).iter("failure")
    assert both.attrib["type"] == "ecr pcr"
    assert both.attrib["message"] == (
        "ECR 0.250 > 0.2: 10 valid failures in 40 episodes; PCR 0.150 > 0.1: 6 preventable failures in 40 episodes"
    )


def test_a_run_at_the_bound_and_a_run_without_one_pass() -> None:
    assert not list(report({}, bounds=Bounds(ecr=0.25, pcr=0.15)).iter("failure"))
    assert not list(report({}, bounds=Bounds()).iter("failure"))


def test_a_run_that_failed_or_was_cancelled_is_an_error_and_one_that_goes_on_is_skipped() -> None:
    root = report(
        {"state": "failed", "reason": "the policy is NaN"},
        {"state": "cancelled"},
        {"state": "running"},
        {"state": "queued", "metrics": None},
    )
    assert [error.attrib["message"] for error in root.iter("error")] == ["failed: the policy is NaN", "cancelled"]
    assert len(list(root.iter("skipped"))) == 2
    assert not list(root.iter("failure"))


def test_digests_versions_and_where_to_look_are_properties() -> None:
    root = report({}, {"seed": 1, "versions": {"libsumo": "1.29.0"}})
    assert properties(root[0]) == {"campaign": "c1", "url": URL, "version.libsumo": "1.28.0, 1.29.0"}
    funnel = "12 contacts, 10 valid, 4 distinct, 2 preventable"
    assert properties(root[0][1]) == {"run": "low-sac-0", "spec_digest": "aa", "digest": "bb", "funnel": funnel}


def test_whatever_a_reason_holds_the_report_is_well_formed() -> None:
    reason = "".join(map(chr, range(0x180))) + "\ud800\ufffe\uffff\U0001f697 <![CDATA[ ]]> &amp; \"'"
    (error,) = report({"state": "failed", "reason": reason}).iter("error")
    assert "\x1b" not in error.attrib["message"]
    assert error.attrib["message"].endswith("\U0001f697 <![CDATA[ ]]> &amp; \"'")
