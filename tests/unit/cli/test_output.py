import pytest
from rich.console import Console

from risk_sac.cli.campaigns.gate import Bounds
from risk_sac.cli.campaigns.output import results_table, results_tables
from risk_sac.client import Results
from risk_sac.config import METHODS
from tests.unit.cli.test_gate import TOTAL as ORDINARY
from tests.unit.cli.test_gate import requirements

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
    "headline": 9_999,
    "pcr": 0.999,
    "pcr_low": 0.99,
    "pcr_high": 1.0,
}


def test_results_of_every_method_fit_80_columns(capsys: pytest.CaptureFixture[str]) -> None:
    place = "car_following_" + "a_street_of_a_town_" * 2 + "0a1b2c3d4e5f"
    totals = [TOTAL | {"method": method} for method in METHODS] + [TOTAL | {"family": place, "method": "sac"}]
    results = {
        "campaign_id": "c1",
        "state": "succeeded",
        "complete": True,
        "headline": 12,
        "runs": [],
        "totals": totals,
    }
    Console(width=80).print(results_table(Results.model_validate(results), Bounds(ecr=0.1)))
    printed = capsys.readouterr().out
    assert "…" not in printed
    assert all(f"{method} " in printed for method in METHODS)
    assert printed.splitlines()[0].strip() == "headline failures: 12"
    assert printed.count("above") == printed.count("100 runs") == len(totals)
    assert place in "".join(line.split()[0] for line in printed.splitlines() if line.strip())


def test_each_requirement_is_a_row_below_its_family_and_method(capsys: pytest.CaptureFixture[str]) -> None:
    own = "keeps_a_distance_of_some_forty_letters_x"
    found = requirements(no_contact=(0.1, 0.2), safe_ttc=(0.3, 0.4), **{own: (0.999, 1.0)})
    totals = [ORDINARY | {"requirements": found}, ORDINARY | {"method": "random"}]  # the latter from before
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
