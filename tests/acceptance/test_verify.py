"""Failures of a real run, replayed in fresh processes; and one whose record was tampered with, which is flaky then."""

import shutil
from pathlib import Path

import pytest

from risk_sac.cli import main
from risk_sac.report import read_run
from risk_sac.run_folder.results import FAILURES, read_results, series_name
from risk_sac.run_folder.series import read_series, write_series
from risk_sac.run_folder.verified import VERIFIED, distinct_failures, read_verified

RUN = ["--family", "low", "--method", "archive", "--seed", "3", "--episodes", "60"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("verified") / "run"
    assert main(["run", *RUN, "--out", str(folder)]) == 0
    return folder


def test_every_distinct_failure_repeats_to_the_bit(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(run), "--times", "2"]) == 0
    found = read_run(run)
    expected = found.metrics["search"].distinct_failures
    assert expected >= 2
    assert found.verified is not None
    assert len(found.verified.episodes) >= expected
    assert all(repetition.verified for repetition in found.verified.episodes.values())
    assert f"{len(found.verified.episodes)} of {len(found.verified.episodes)} distinct" in capsys.readouterr().out
    noted = (run / VERIFIED).stat().st_mtime_ns
    assert main(["verify", str(run), "--times", "1"]) == 0  # which it was already
    assert (run / VERIFIED).stat().st_mtime_ns == noted


def test_what_does_not_repeat_is_flaky_and_counts_as_no_failure(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns(VERIFIED))
    first = distinct_failures(read_results(tmp_path / "run"))[0]
    file = tmp_path / "run" / FAILURES / series_name(first.index)
    series = read_series(file)
    series["actions"][-5:] *= -1.0
    write_series(file, series)
    assert main(["verify", str(tmp_path / "run"), "--times", "2"]) == 1
    assert f"flaky: episode {first.index}, 0 of 2 times the same" in capsys.readouterr().out
    whole, tampered = read_run(run), read_run(tmp_path / "run")
    assert tampered.verified is not None
    assert tampered.verified.flaky == {first.index}
    assert tampered.found[first.index].distinct == whole.found[first.index].distinct - 1
    refused = sum("repeats" in record.reason for record in tampered.records)
    assert refused >= 1
    assert tampered.metrics["search"].failures == whole.metrics["search"].failures - refused
    assert tampered.metrics["search"].raw_collisions == whole.metrics["search"].raw_collisions
    assert tampered.digest == whole.digest


def test_verifying_other_results_does_not_count(run: Path) -> None:
    assert read_verified(run, "0" * 64) is None
