import pytest
from rich.console import Console

from risk_sac.cli.campaigns.gate import Bounds
from risk_sac.cli.campaigns.output import line, results_table
from risk_sac.client import CampaignSummary, Results
from risk_sac.config import METHODS
from tests.unit.cli.test_gate import TOTAL as ORDINARY
from tests.unit.client.scripted_server import PROGRESS, campaign

TOTAL = ORDINARY | {
    "family": "dense",
    "runs": 100,
    "episodes": 100_000,
    "raw_collisions": 99_999,
    "failures": 99_999,
    "ecr": 0.999,
    "ecr_low": 0.99,
    "ecr_high": 1.0,
    "distinct_failures": 9_999,
    "preventable": 9_999,
    "distinct_preventable": 9_999,
    "pcr": 0.999,
    "pcr_low": 0.99,
    "pcr_high": 1.0,
}


def test_results_of_every_method_fit_80_columns(capsys: pytest.CaptureFixture[str]) -> None:
    place = "car_following_" + "a_street_of_a_town_" * 2 + "0a1b2c3d4e5f"
    totals = [TOTAL | {"method": method} for method in METHODS] + [TOTAL | {"family": place, "method": "sac"}]
    results = {"campaign_id": "c1", "state": "succeeded", "complete": True, "runs": [], "totals": totals}
    Console(width=80).print(results_table(Results.model_validate(results), Bounds(ecr=0.1)))
    printed = capsys.readouterr().out
    assert "…" not in printed
    assert all(f"{method} " in printed for method in METHODS)
    assert printed.count("above") == printed.count("100 runs") == len(totals)
    assert place in "".join(line.split()[0] for line in printed.splitlines() if line.strip())


def test_a_rate_that_may_be_above_says_up_to_where(capsys: pytest.CaptureFixture[str]) -> None:
    few = TOTAL | {"method": "sac", "episodes": 60, "failures": 3, "ecr": 0.05, "ecr_low": 0.02, "ecr_high": 0.137}
    results = {"campaign_id": "c1", "state": "succeeded", "complete": True, "runs": [], "totals": [few]}
    Console(width=80).print(results_table(Results.model_validate(results), Bounds(ecr=0.1)))
    printed = capsys.readouterr().out
    assert "up to 0.14" in printed
    assert "above" not in printed


@pytest.mark.parametrize(("count", "said"), [(0, "0 failures"), (1, "1 failure"), (2, "2 failures")])
def test_one_failure_is_no_failures(count: int, said: str) -> None:
    progress = PROGRESS | {"episodes_done": 1, "episodes_total": 1, "failures": count, "distinct_preventable": 1}
    found = CampaignSummary.model_validate(campaign(progress=progress))
    assert line(found).startswith(f"c1 running: 1/1 episode, {said}, 1 distinct")
