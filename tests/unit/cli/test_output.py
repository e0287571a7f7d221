import pytest
from rich.console import Console

from risk_sac.cli.campaigns.gate import Bounds
from risk_sac.cli.campaigns.output import results_table
from risk_sac.client import Results
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
