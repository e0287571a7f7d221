"""Failures of registered egos in this and another process, in every use."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import pytest

from risk_sac.cli import main
from risk_sac.failures.bundle import read_bundle
from risk_sac.failures.studied import Regression, Verdict
from risk_sac.failures.variants import VariantPlayer
from risk_sac.run_folder.results import first_of_variants, read_results, read_verified
from tests.ego_processes import served

RUN = ["--scenario", "low", "--method", "archive", "--seed", "41", "--episodes", "30", "--behaviour", "emergency"]


@dataclass(frozen=True)
class Found:
    """A run, and a bundle of one of its failures."""

    run: Path
    bundle: Path


def register(monkeypatch: pytest.MonkeyPatch, folder: Path, table: str) -> None:
    (folder / "egos.toml").write_text(f"[far]\n{table}")
    monkeypatch.setenv("RISK_SAC_EGOS", str(folder / "egos.toml"))


def found(folder: Path, ego: str) -> Found:
    assert main(["run", *RUN, "--ego", ego, "--out", str(folder / "run")]) == 0
    first = next(iter(first_of_variants(read_results(folder / "run"))))
    assert main(["bundle", str(folder / "run"), str(first.index), "--out", str(folder / "one.npz")]) == 0
    return Found(folder / "run", folder / "one.npz")


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> Found:
    return found(tmp_path_factory.mktemp("near"), "broken")


@pytest.fixture(scope="module")
def far(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Found, str]]:
    """And what registers the ego, whose process lives on for a test."""
    pytest.importorskip("grpc")
    folder = tmp_path_factory.mktemp("far")
    with pytest.MonkeyPatch.context() as patch, served("broken", folder, deadline_s=60, response_time_s=1.0) as table:
        register(patch, folder, table)
        yield found(folder, "far"), table


def test_a_failure_of_an_ego_in_our_process_repeats(near, tell):
    status, out, _ = tell("replay", near.bundle)
    assert status == 0
    assert "every array is as recorded" in out


def test_a_better_ego_is_another_and_the_same_one_fails_still(near, tell, tmp_path):
    for ego in ("broken", "r157"):
        tell("regress", "--failures", near.bundle, "--ego", ego, "--out", tmp_path / f"{ego}.json")
    own, better = (
        Regression.model_validate_json((tmp_path / f"{ego}.json").read_bytes()) for ego in ("broken", "r157")
    )
    assert [case.verdict for case in own.cases] == [Verdict.STILL_FAILING]
    assert better.ego.driver == "r157"
    assert all(case.verdict is not Verdict.FLAKY for case in better.cases)


def test_sumo_itself_repeats_an_episode_in_which_it_did_not_drive_the_ego(near, tell, tmp_path):
    assert tell("export", near.bundle, "--format", "sumo", "--out", tmp_path / "sumo")[0] == 0
    done = subprocess.run([sys.executable, tmp_path / "sumo" / "replay.py"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "largest difference 0; 0 missing" in done.stdout


def test_failures_of_an_ego_in_another_process_repeat(far, near, tell, monkeypatch, tmp_path):
    failure, table = far
    register(monkeypatch, tmp_path, table)
    assert read_results(failure.run).digest == read_results(near.run).digest
    assert tell("verify", failure.run)[0] == 0
    verified = read_verified(failure.run, read_results(failure.run).digest)
    assert verified is not None
    assert verified.episodes
    assert not verified.flaky
    assert tell("replay", failure.bundle)[0] == 0
    with closing(VariantPlayer(read_bundle(failure.bundle)).env):
        pass  # it happens again


def test_where_the_ego_is_gone_whatever_plays_it_says_which(far, tell, monkeypatch, tmp_path):
    failure, table = far
    address = next(line for line in table.splitlines() if line.startswith("address"))
    register(monkeypatch, tmp_path, table.replace(address, 'address = "127.0.0.1:9"'))  # a closed port
    (failure.run / "verified.json").unlink(missing_ok=True)
    index = read_bundle(failure.bundle).manifest.episode.index
    for command in (
        ("replay", failure.bundle),
        ("minimise", failure.bundle, "--out", tmp_path / "core.npz"),
        ("bundle", failure.run, index, "--out", tmp_path / "again.npz"),
        ("show", failure.run, index, "--twin", "idle", "--out", tmp_path / "twin.png"),
        ("export", failure.bundle, "--format", "sumo", "--out", tmp_path / "sumo"),
    ):
        status, _, err = tell(*command)
        assert status == 1, command
        assert "the ego 'far' is not there" in err, command
        assert "127.0.0.1" not in err, command  # the operator's business
    assert tell("verify", failure.run)[0] == 1
    assert not (failure.run / "verified.json").exists()
    tell("regress", "--failures", failure.bundle, "--ego", "r157", "--out", tmp_path / "cases.json")
    (case,) = Regression.model_validate_json((tmp_path / "cases.json").read_bytes()).cases
    assert case.verdict is Verdict.NOT_COMPARABLE
    assert "'far' is not there" in case.reason


def test_where_the_ego_is_of_another_version_it_is_refused_by_both(far, tell, monkeypatch, tmp_path):
    failure, table = far
    version = next(line for line in table.splitlines() if line.startswith("version"))
    register(monkeypatch, tmp_path, table.replace(version, 'version = "another"'))
    (failure.run / "verified.json").unlink(missing_ok=True)
    for command in (("replay", failure.bundle), ("bundle", failure.run, "--out", tmp_path), ("verify", failure.run)):
        status, _, err = tell(*command)
        assert status in (1, 2), command
        if command[0] != "verify":  # whose processes say it to the log
            assert "'another'" in err, command
            assert version.partition('"')[2].rstrip('"') in err, command
    monkeypatch.setenv("RISK_SAC_EGOS", "")
    status, _, err = tell("replay", failure.bundle)
    assert status == 2
    assert "ego.driver: got 'far'" in err
