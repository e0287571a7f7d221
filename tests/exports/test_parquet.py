"""Parquet, read by pyarrow."""

import json
from pathlib import Path

import pytest
from pyarrow import compute, parquet

from risk_sac.cli import main
from risk_sac.failures.export.parquet import SPECS
from risk_sac.records import Outcome
from risk_sac.run_folder.results import EPISODES, records_from_lines

RUNS = {"low": "random", "mixed": "random"}
OWN = {"requirements": [{"name": "never_fast", "formula": "ego_speed_mps <= 5", "scale": 5}]}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, spec = tmp_path_factory.mktemp("runs"), tmp_path_factory.mktemp("spec") / "spec.json"
    spec.write_text(json.dumps(OWN))
    for family, method in RUNS.items():
        command = [
            "run",
            "--spec",
            str(spec),
            "--scenario",
            family,
            "--method",
            method,
            "--episodes",
            "20",
            "--seed",
            "601",
        ]
        assert main([*command, "--out", str(folder / family)]) == 0
    return folder


def test_every_episode_of_every_run_is_a_row_with_its_fields(runs: Path, tmp_path: Path) -> None:
    file = tmp_path / "episodes.parquet"
    assert main(["export", str(runs), "--format", "parquet", "--out", str(file)]) == 0
    table = parquet.read_table(file)
    records = {family: records_from_lines((runs / family / EPISODES).read_bytes()) for family in RUNS}
    assert table.num_rows == sum(map(len, records.values())) >= 40
    for family, method in RUNS.items():
        mine = table.filter(compute.equal(table["family"], family))
        assert mine["method"].unique().to_pylist() == [method]
        for row, record in zip(mine.to_pylist(), records[family], strict=True):
            assert row["id"] == record.id_in(f"{family}-{method}-601")
            assert (row["outcome"], row["steps"], row["seed"]) == (record.outcome, record.steps, record.seed)
            assert dict(row["scene"]) == dict(record.scene)
            assert row["driven_by"] == record.driven_by
            assert row["min_ttc_s"] == record.min_ttc_s
            assert (row["collision"] is None) == (record.collision is None)
            requirements = {name: result.model_dump() for name, result in record.requirements.items()}
            assert dict(row["requirements"]) == requirements
            assert row["failed"] == list(record.failed)
            assert [each["requirement"] for each in row["violations"]] == [
                each.requirement for each in record.violations
            ]
            worst = record.worst_violation if record.outcome is Outcome.FAILURE else None
            assert row["prevented_by"] == ([name for name, kept in worst.prevention.items() if kept] if worst else None)
            assert row["fault"] == (worst.blamed if worst else None)
            if worst is not None and worst is record.collision:
                assert row["severity"] == worst.judgement.severity in ("minor", "moderate", "severe")
                assert row["injury_risk"] == worst.judgement.injury_risk
            if record.collision is not None:
                assert dict(row["collision"]["verdicts"]) == dict(record.collision.verdicts)
                assert row["collision"]["early_min_ttc_s"] == record.collision.early_min_ttc_s
    assert sum("never_fast" in row for row in table["failed"].to_pylist()) > 10
    specs = json.loads(table.schema.metadata[SPECS])
    assert {spec["family"] for spec in specs.values()} == set(RUNS)


def test_runs_that_differ_in_their_odd_alone_keep_their_specs_and_ids_apart(tmp_path: Path) -> None:
    run = {"family": "low", "method": "random", "seed": 5, "budget": {"episodes": 2}}
    odds = {"dry": {}, "wet": {"environment": {"friction": {"low": 0.6, "high": 0.65}}}}
    for name, odd in odds.items():
        (tmp_path / "spec.json").write_text(json.dumps(run | {"odd": odd}))
        assert main(["run", "--spec", str(tmp_path / "spec.json"), "--out", str(tmp_path / "runs" / name)]) == 0
    file = tmp_path / "both.parquet"
    assert main(["export", str(tmp_path / "runs"), "--format", "parquet", "--out", str(file)]) == 0
    table = parquet.read_table(file)
    specs = json.loads(table.schema.metadata[SPECS])
    assert len({json.dumps(spec["odd"]) for spec in specs.values()}) == 2
    assert set(table["run_id"].to_pylist()) == set(specs)
    assert len(set(table["id"].to_pylist())) == table.num_rows == 4
