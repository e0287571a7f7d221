import io
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from typing import Any

from risk_sac.cli.campaigns.gate import Bounds
from risk_sac.cli.campaigns.junit import junit
from risk_sac.client import Episode, Results
from tests.builders import run_metrics
from tests.unit.cli.test_gate import TOTAL

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


def test_whatever_a_reason_holds_the_report_is_well_formed() -> None:
    reason = "".join(map(chr, range(0x180))) + "\ud800\ufffe\uffff\U0001f697 <![CDATA[ ]]> &amp; \"'"
    (error,) = report({"state": "failed", "reason": reason}).iter("error")
    assert "\x1b" not in error.attrib["message"]
    assert error.attrib["message"].endswith("\U0001f697 <![CDATA[ ]]> &amp; \"'")
