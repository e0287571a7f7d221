"""Table of finds in a planner: equal steps, ranges and tests."""

from pathlib import Path

import pytest

from risk_sac.lab.figures.planner_table import Row, counted, finish, lines, p_value, spec_of, spent
from risk_sac.records import Outcome
from risk_sac.report.runs import read_run
from risk_sac.run_folder.results import EPISODES, FAILURES, read_results
from tests.builders import collision, episode_record


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Run of four episodes of 100 steps, the last two failures."""
    safe = [episode_record(index) for index in range(2)]
    failed = [episode_record(index, Outcome.FAILURE, collision=collision()) for index in (2, 3)]
    (tmp_path / EPISODES).write_text("".join(record.model_dump_json() + "\n" for record in safe + failed))
    return tmp_path


@pytest.mark.parametrize(("steps", "episodes", "distinct"), [(250, 2, 0), (300, 3, 1), (900, 4, 1)])
def test_what_ends_after_the_steps_does_not_count(run: Path, steps: int, episodes: int, distinct: int) -> None:
    row = counted(spec_of("low", "random", "default", 1), run, steps)
    assert (row["seed"], row["episodes"], row["environment_steps"]) == (1, episodes, 100 * episodes)
    assert row["distinct_failures"] == distinct


def test_a_run_goes_on_that_has_spent_fewer_steps(run: Path) -> None:
    assert spent(run, 400)
    assert not spent(run, 401)
    assert not spent(run / "none", 1)


def test_a_finished_run_holds_what_ends_within_the_steps(run: Path, tmp_path: Path) -> None:
    (run / FAILURES).mkdir()
    finish(spec_of("low", "random", "default", 1), run, 300, tmp_path / "finished")
    assert [record.index for record in read_run(tmp_path / "finished").records] == [0, 1, 2]
    assert [failure.episode.index for failure in read_results(tmp_path / "finished").failures] == [2]


def test_a_line_has_median_range_and_p_against_random_search() -> None:
    def row(method: str, seed: int, found: int) -> Row:
        counts = {"distinct_failures": found, "distinct_preventable": 0, "headline_candidates": 0}
        return {"family": "low", "method": method, "seed": seed, **counts}

    rows = [row("archive", seed, 10 + seed) for seed in range(5)] + [row("random", seed, seed) for seed in range(5)]
    *_, archive, random = lines(rows)
    assert archive == "| low | archive | 5 | 12 (10 to 14), p 0.01 | 0 (0 to 0), p 1.00 | 0 (0 to 0), p 1.00 |"
    assert random == "| low | random | 5 | 2 (0 to 4) | 0 (0 to 0) | 0 (0 to 0) |"
    assert p_value([1, 2, 3, 4, 5], [6, 7, 8, 9, 10]) == pytest.approx(2 / 252)  # of the ways to choose 5 of 10
