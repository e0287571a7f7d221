import pytest
from rich.console import Console

from risk_sac.cli.campaigns.gate import Bounds
from risk_sac.cli.campaigns.output import line, results_table
from risk_sac.client import CampaignSummary, Results
from risk_sac.config import METHODS

TOTAL = {
    "family": "dense",
    "runs": 100,
    "episodes": 100_000,
    "raw_collisions": 99_999,
    "failures": 99_999,
    "ecr": 0.999,
    "ecr_low": 0.99,
    "ecr_high": 1.0,
    "efficiency": 0.0,
    "cost_rate": 0.0,
    "dispersion": None,
    "distinct_failures": 9_999,
    "steps_per_distinct_failure": None,
    "preventable": 9_999,
    "distinct_preventable": 9_999,
    "pcr": 0.999,
    "pcr_low": 0.99,
    "pcr_high": 1.0,
    "unresponsive": 0,
    "signatures": {},
    "conflicts_by_second": [],
    "contacts_by_second": [],
}


def test_results_of_every_method_fit_80_columns(capsys: pytest.CaptureFixture[str]) -> None:
    totals = [TOTAL | {"method": method} for method in METHODS]
    results = {"campaign_id": "c1", "state": "succeeded", "complete": True, "runs": [], "totals": totals}
    Console(width=80).print(results_table(Results.model_validate(results), Bounds(ecr=0.1)))
    printed = capsys.readouterr().out
    assert "…" not in printed
    assert all(f"{method} " in printed for method in METHODS)
    assert printed.count("above") == printed.count("100 runs") == len(METHODS)


def test_a_rate_that_may_be_above_says_up_to_where(capsys: pytest.CaptureFixture[str]) -> None:
    few = TOTAL | {"method": "sac", "episodes": 60, "failures": 3, "ecr": 0.05, "ecr_low": 0.02, "ecr_high": 0.137}
    results = {"campaign_id": "c1", "state": "succeeded", "complete": True, "runs": [], "totals": [few]}
    Console(width=80).print(results_table(Results.model_validate(results), Bounds(ecr=0.1)))
    printed = capsys.readouterr().out
    assert "up to 0.14" in printed
    assert "above" not in printed


@pytest.mark.parametrize(("count", "said"), [(0, "0 failures"), (1, "1 failure"), (2, "2 failures")])
def test_one_failure_is_no_failures(count: int, said: str) -> None:
    progress = {
        "episodes_done": 1,
        "episodes_total": 1,
        "failures": count,
        "raw_collisions": 2,
        "distinct_failures": 1,
        "preventable": 1,
        "distinct_preventable": 1,
        "window_ecr": 1.0,
        "window_pcr": 1.0,
        "dual_variable": None,
        "eta_s": None,
    }
    campaign = {"id": "c1", "label": "", "state": "running", "reason": None, "created_at": 0, "progress": progress}
    assert line(CampaignSummary.model_validate(campaign)).startswith(f"c1 running: 1/1 episode, {said}, 1 distinct")
