"""Folder sweep: a row per variation file and ego, with counted outcomes."""

from pathlib import Path

from risk_sac.lab.figures.openscenario_sweeps import Cell, Sweep, imported, markdown, outcomes, play, variations
from risk_sac.records import Outcome
from risk_sac.report.grid import StandardVerdict
from tests.builders import collision, episode_record
from tests.openscenario_samples import SCENARIO, VARIATION, copied


def test_variation_files_are_those_with_parameter_values(tmp_path: Path) -> None:
    there = copied(tmp_path)
    assert variations(tmp_path, ["*"]) == [there / VARIATION]
    assert variations(tmp_path, [Path(SCENARIO).stem]) == []


def test_an_imported_file_has_the_size_of_its_grid_and_no_path_of_the_machine(tmp_path: Path) -> None:
    sweep = imported(copied(tmp_path) / VARIATION, tmp_path)
    assert (sweep.scenario, sweep.fault) == ("files/variation", "")
    assert sweep.grid > 1
    assert sweep.entities > 1


def test_a_file_that_cannot_be_imported_is_a_row_with_its_fault(tmp_path: Path) -> None:
    there = copied(tmp_path)
    (there / SCENARIO).unlink()
    sweep = imported(there / VARIATION, tmp_path)
    row = play(tmp_path, 1, Cell(sweep, "default"))
    assert SCENARIO in row["fault"]
    assert row["points"] == 0


def test_points_are_refused_passed_or_failed() -> None:
    records = [
        episode_record(0),
        episode_record(1, Outcome.REJECTED, reason="constraint"),
        episode_record(2, Outcome.FAILURE, collision=collision()),
    ]
    verdicts = [StandardVerdict.PASS, StandardVerdict.REFUSED, StandardVerdict.OUT_OF_SCOPE]
    row = outcomes(records, verdicts)
    assert (row["points"], row["refused"], row["pass"], row["contact"]) == (3, "constraint:1", 1, 1)
    assert (row["r157_fail"], row["r157_out_of_scope"], row["unjudged"]) == (0, 1, 0)


def test_a_row_that_is_there_is_not_played_again(tmp_path: Path) -> None:
    cell = Cell(Sweep("files/variation", "variation_000000000000"), "default")
    folder = tmp_path / "runs" / "variation_000000000000-default-3"
    folder.mkdir(parents=True)
    (folder / "row.json").write_text('{"points": 3}')
    assert play(tmp_path, 3, cell) == {"points": 3}


def test_the_table_has_a_line_per_scenario_and_a_column_per_ego() -> None:
    row = Sweep("a/b/cut_in_variation", "x", 2, 3, 40)._asdict() | outcomes([episode_record(0)], [StandardVerdict.PASS])
    lines = markdown([row | {"ego": ego} for ego in ("default", "idm-aeb")]).splitlines()
    assert [cell.strip() for cell in lines[0].split("|")[-3:-1]] == ["default", "idm-aeb"]
    cells = [cell.strip() for cell in lines[2].split("|")[1:-1]]
    assert cells == ["b/cut_in", "2", "3", "40", "0", "1", "–", "1, 0, 0", "1, 0, 0"]
