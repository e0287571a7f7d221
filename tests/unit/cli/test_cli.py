import argparse
import os
import re
from dataclasses import replace
from pathlib import Path

import pytest

from risk_sac import cli
from risk_sac.execution.evaluate import run
from risk_sac.run_folder.results import RunResults, read_results, write_results
from tests.unit.cli.conftest import SPEC, ignore


def untimed(results: RunResults) -> RunResults:
    """Without what differs from one execution to the next."""
    return replace(results, wall_s=0.0, cpu_s=0.0, episode_cpu_s=())


@pytest.mark.parametrize("form", ["{run}-search-{index}", "search-{index}", "{index:06d}", "{index}"])
def test_show_draws_by_the_services_id_or_any_part_that_tells_it(folder, tmp_path, form):
    results = read_results(folder)
    index = results.failures[0].episode.index
    picture = tmp_path / "contact.png"
    wanted = form.format(run=results.spec.id, index=index)
    assert cli.main(["show", str(folder / "results.json"), wanted, "--out", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert cli.main(["show", str(folder), wanted]) == 0
    assert (folder / results.failures[0].series).with_suffix(".png").exists()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--scenario", "high"], "--scenario: "),
        (["--scenario", "low", "--method", "magic"], "--method: "),
        (["--scenario", "low", "--ego", "nobody-s"], "--ego: "),
        (["--scenario", "low", "--ego", "No/body"], "--ego: "),
        (["--scenario", "low", "--episodes", "-3"], "--episodes: "),
        (["--scenario", "low", "--seed", "-1"], "--seed: "),
        ([], "--scenario is missing; choose low, mixed or dense"),
        (["--spec", "nowhere.yaml"], "--spec: "),
    ],
)
def test_wrong_settings_name_the_field_and_leave_no_folder(arguments, complaint, tmp_path, capsys):
    assert cli.main(["run", *arguments, "--out", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith(complaint)
    assert "Traceback" not in printed
    assert not (tmp_path / "out").exists()


def test_folder_of_another_run_is_refused_and_kept(folder, capsys):
    before = (folder / "results.json").read_bytes()
    assert cli.main(["run", "--scenario", "low", "--method", "sac", "--episodes", "8", "--out", str(folder)]) == 2
    assert "holds a run with another method, seed" in capsys.readouterr().err
    assert (folder / "results.json").read_bytes() == before


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert cli.main(["run", "--scenario", "low", "--method", "random", "--out", str(tmp_path / "file" / "out")]) == 2
    complaint = capsys.readouterr().err
    assert re.fullmatch(r"--out: got .*/file/out, which cannot be written \(Not a directory\); wanted .*\n", complaint)


def test_killed_run_repeats_what_its_checkpoint_lacks(tmp_path):
    whole = run(SPEC, tmp_path, ignore)
    (tmp_path / "checkpoint").unlink()  # as if killed before the first one
    write_results(
        tmp_path, replace(whole, metrics=None, digest=None, finished=False, failures=(), wall_s=0.0, cpu_s=0.0)
    )
    (tmp_path / "episodes.jsonl").write_text("stale\n" * 5)
    again = run(SPEC, tmp_path, ignore)
    assert untimed(again) == untimed(whole)
    assert len((tmp_path / "episodes.jsonl").read_text().splitlines()) == 3


def test_a_command_takes_all_paths_from_where_it_begins(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RISK_SAC_PLACES", "places")
    monkeypatch.delenv("RISK_SAC_EGOS", raising=False)
    options = argparse.Namespace(out=Path("run"), runs=[Path("a"), Path("/b")], name="run", seed=3)
    cli._make_absolute(options)
    assert vars(options) == {"out": tmp_path / "run", "runs": [tmp_path / "a", Path("/b")], "name": "run", "seed": 3}
    assert os.environ["RISK_SAC_PLACES"] == str(tmp_path / "places")
    assert "RISK_SAC_EGOS" not in os.environ
