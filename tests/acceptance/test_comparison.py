"""The comparison that is shipped is complete, still speaks of this version's settings, and can be had again."""

import json
from pathlib import Path

import pytest

from risk_sac.config import METHODS
from risk_sac.local_run import run
from risk_sac.report.provenance import this_platform
from risk_sac.spec_file import read_campaign, read_spec

SHIPPED = Path(__file__).parents[2] / "risk_sac" / "comparison"
TABLE = json.loads((SHIPPED / "table.json").read_text(encoding="utf-8"))


def test_every_method_ran_to_the_end_on_equal_budgets() -> None:
    assert TABLE["missing"] == []
    ran = {(row["family"], row["method"], row["seed"]) for row in TABLE["runs"]}
    seeds = TABLE["spec"]["seeds"]
    assert len(seeds) >= 5
    assert ran == {
        (family, method, seed) for family in ("low", "mixed", "dense") for method in METHODS for seed in seeds
    }
    assert {row["metrics"]["search"]["episodes"] for row in TABLE["runs"]} == {TABLE["spec"]["budget"]["episodes"]}


def test_its_settings_are_those_of_this_version() -> None:
    assert read_campaign(SHIPPED / "spec.yaml", {}, {}).digest == TABLE["spec_digest"]


@pytest.mark.skipif(
    TABLE["platform"] != this_platform(), reason="digests are compared on the kind of machine that made them"
)
def test_a_run_of_it_comes_out_the_same_to_the_digit(tmp_path: Path) -> None:
    row = next(each for each in TABLE["runs"] if (each["family"], each["method"]) == ("low", "random"))
    spec = read_spec(SHIPPED / "spec.yaml", {"family": "low", "method": "random", "seed": row["seed"]})
    again = run(spec, tmp_path / "run", lambda done, metrics: None)
    assert again.digest == row["digest"]
