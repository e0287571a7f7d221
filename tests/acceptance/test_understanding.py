"""Real failures: replays, bundles, cores, regions, twins, and other egos."""

import shutil
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from risk_sac.cli import main
from risk_sac.config import EgoConfig
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import ConfigError
from risk_sac.failures.bundle import MOST_POLICY_BYTES, Bundle, make_bundle, read_bundle, write_bundle
from risk_sac.failures.minimise import COPIES, MOST, SHARE
from risk_sac.failures.play import play
from risk_sac.failures.recording import actions_of
from risk_sac.failures.regress import regress, regress_run
from risk_sac.failures.studied import Regression, Verdict
from risk_sac.failures.study import bundles, policy_of
from risk_sac.failures.variants import VariantPlayer
from risk_sac.report import read_run
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, VERIFIED, first_of_variants, read_results, read_verified, series_name
from risk_sac.run_folder.series import pack_series, write_series
from risk_sac.search.frozen_policy import FrozenPolicy
from tests.acceptance.conftest import Tell
from tests.acceptance.test_bundle import changed, manifest, series

RUN = ["--scenario", "low", "--method", "archive", "--seed", "3", "--episodes", "60", "--behaviour", "emergency"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("understood") / "run"
    assert main(["run", *RUN, "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def failures(run: Path) -> Path:
    """A bundle of every distinct failure."""
    folder = run.parent / "failures"
    assert main(["bundle", str(run), "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def failure(failures: Path) -> Path:
    """The first failure whose copies fail too, so that it can shrink."""
    for file in sorted(failures.iterdir()):
        stage = VariantPlayer(read_bundle(file))
        with closing(stage.env):
            if all(stage.fails(copy) for copy in stage.copies(stage.original, SHARE, COPIES, np.random.default_rng(0))):
                return file
    raise AssertionError("all of them are needles")


def struck(bundle: Bundle) -> tuple[object, ...]:
    collision = bundle.manifest.episode.collision
    assert collision is not None
    return collision.valid, collision.other_id, collision.judgement.conflict_type, collision.judgement.grade


def test_every_distinct_failure_repeats_to_the_bit(run, capsys):
    assert main(["verify", str(run), "--times", "2"]) == 0
    found = read_run(run)
    expected = found.metrics["search"].variants
    assert expected >= 2
    assert found.verified is not None
    assert len(found.verified.episodes) >= expected
    assert all(repetition.verified for repetition in found.verified.episodes.values())
    assert f"{len(found.verified.episodes)} of {len(found.verified.episodes)} failure" in capsys.readouterr().out
    noted = (run / VERIFIED).stat().st_mtime_ns
    assert main(["verify", str(run), "--times", "1"]) == 0  # which it was already
    assert (run / VERIFIED).stat().st_mtime_ns == noted


def tampered_with(run: Path) -> int:
    """Changes actions of the first distinct failure, and returns its index."""
    index = first_of_variants(read_results(run))[0].index
    file = run / FAILURES / series_name(index)
    arrays = read_series(file)
    arrays["actions"][-5:] *= -1.0
    write_series(file, pack_series(arrays))
    return index


def test_what_does_not_repeat_is_flaky_and_counts_as_no_failure(run, tmp_path, capsys):
    shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns(VERIFIED))
    first = tampered_with(tmp_path / "run")
    assert main(["verify", str(tmp_path / "run"), "--times", "2"]) == 1
    assert f"flaky: episode {first}, 0 of 2 times the same" in capsys.readouterr().out
    whole, tampered = read_run(run), read_run(tmp_path / "run")
    assert tampered.verified is not None
    assert tampered.verified.flaky == {first}
    assert tampered.found[first].distinct == whole.found[first].distinct - 1
    refused = sum("repeats" in record.reason for record in tampered.records)
    assert refused >= 1
    assert tampered.metrics["search"].failures == whole.metrics["search"].failures - refused
    assert tampered.metrics["search"].raw_collisions == whole.metrics["search"].raw_collisions
    assert tampered.digest == whole.digest
    assert read_verified(run, "0" * 64) is None  # of other results


def test_a_core_does_less_and_fails_in_the_same_way_as_surely(
    run: Path, failure: Path, tmp_path: Path, tell: Tell
) -> None:
    index = read_bundle(failure).manifest.episode.index
    status, out, _ = tell("minimise", run, index, "--out", tmp_path / "core.npz")
    assert status == 0
    origin, minimal = read_bundle(failure), read_bundle(tmp_path / "core.npz")
    core = minimal.manifest.core
    assert core is not None
    assert core.sentence in out
    assert read_run(run).studies[index].core == core  # where the report finds it
    assert struck(minimal) == struck(origin)
    assert core.held >= COPIES // 2  # of copies that it was not chosen by
    assert minimal.manifest.episode.script is None
    assert core.episodes <= MOST
    assert core.after.segments < core.before.segments
    assert core.after.adversaries <= core.before.adversaries
    done = np.count_nonzero(np.nan_to_num(minimal.series["actions"]))
    assert 0 < done < np.count_nonzero(np.nan_to_num(origin.series["actions"]))
    assert tell("replay", tmp_path / "core.npz")[0] == 0


def test_a_more_plausible_motion_fails_alike_and_its_bundle_keeps_the_recording(
    failure: Path, tmp_path: Path, tell: Tell
) -> None:
    file = tmp_path / "likely.npz"
    assert tell("minimise", failure, "--aim", "most-plausible", "--out", file)[0] == 0
    origin, likelier = read_bundle(failure), read_bundle(file)
    motion = likelier.manifest.plausible
    assert motion is not None
    assert motion.after < motion.before
    assert struck(likelier) == struck(origin)
    assert likelier.recorded is not None
    assert likelier.recorded.manifest.digest == origin.manifest.digest
    assert likelier.manifest.digest != origin.manifest.digest
    assert tell("replay", file)[0] == 0


def regressed(tell: Tell, tmp_path: Path, *arguments: object) -> tuple[int, list[Verdict]]:
    status, *_ = tell("regress", *arguments, "--out", tmp_path / "cases.json")
    cases = Regression.model_validate_json((tmp_path / "cases.json").read_bytes()).cases
    return status, [case.verdict for case in cases]


def test_with_its_own_ego_every_failure_still_fails_and_a_baseline_accepts_that(failures, tmp_path, tell):
    status, verdicts = regressed(tell, tmp_path, "--failures", failures, "--ego", "default")
    assert status == 1
    assert set(verdicts) == {Verdict.STILL_FAILING}
    (tmp_path / "cases.json").rename(tmp_path / "known.json")
    again = ("--failures", failures, "--ego", "default", "--baseline", tmp_path / "known.json")
    assert regressed(tell, tmp_path, *again)[0] == 0


def test_what_still_fails_is_exported_as_the_other_ego_has_it(failure, tmp_path, tell):
    exports = tmp_path / "exports"
    asked = ("--failures", failure, "--ego", "default", "--exports", exports, "--format", "gif")
    assert regressed(tell, tmp_path, *asked) == (1, [Verdict.STILL_FAILING])
    (bundle,), (gif,) = exports.rglob("*.npz"), exports.rglob("*.gif")
    assert gif.read_bytes().startswith(b"GIF8")
    assert tell("replay", bundle)[0] == 0


def test_a_better_ego_fixes_more_than_a_worse_one(failures, tmp_path, tell):
    (tmp_path / "slow.yaml").write_text("reaction_time_s: 1.0\n")
    fixed = {}
    for ego in ("perfect", tmp_path / "slow.yaml"):
        _, verdicts = regressed(tell, tmp_path, "--failures", failures, "--ego", ego)
        fixed[str(ego)] = verdicts.count(Verdict.FIXED)
    better, worse = fixed.values()
    assert better > worse


def test_what_is_flaky_or_of_another_net_never_counts_as_fixed(failure, tmp_path, tell):
    def tamper(arrays: dict[str, np.ndarray]) -> None:
        series(arrays, actions=np.where(np.isnan(arrays["actions"]), np.nan, -arrays["actions"]))

    sets = tmp_path / "set"
    sets.mkdir()
    changed(failure, sets / "flaky.npz", tamper)
    changed(failure, sets / "net.npz", lambda arrays: manifest(arrays, world={}))
    status, verdicts = regressed(tell, tmp_path, "--failures", sets, "--ego", "careful", "--junit", tmp_path / "j.xml")
    assert status == 1
    assert verdicts == [Verdict.FLAKY, Verdict.NOT_COMPARABLE]
    assert (tmp_path / "j.xml").read_text().count("<error") == 2


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--ego", "nobody.yaml"], "nobody.yaml', which is no file"),
        (["--ego", "default", "--baseline", "nothing.json"], "nothing.json, which cannot be read"),
    ],
    ids=["no ego", "no baseline"],
)
def test_what_is_missing_is_said_before_anything_is_played(arguments, complaint, failures, tmp_path, tell):
    status, _, err = tell("regress", "--failures", failures, *arguments, "--out", tmp_path / "cases.json")
    assert status == 2
    assert complaint in err
    assert not (tmp_path / "cases.json").exists()


@pytest.mark.parametrize("verb", ["minimise", "region"])
def test_what_does_not_happen_here_has_neither_core_nor_region(verb, failure, tmp_path, tell):
    def still(arrays: dict[str, np.ndarray]) -> None:
        series(arrays, actions=np.where(np.isnan(arrays["actions"]), np.nan, 0.0))

    changed(failure, tmp_path / "still.npz", still)
    status, _, err = tell(verb, tmp_path / "still.npz", "--out", tmp_path / "out")
    assert status == 1
    assert "does not happen here" in err
    changed(failure, tmp_path / "net.npz", lambda arrays: manifest(arrays, world={}))
    status, _, err = tell(verb, tmp_path / "net.npz", "--out", tmp_path / "out")
    assert status == 2
    assert "was found on another" in err
    assert not (tmp_path / "out").exists()


class Sharp:
    """A policy that drives as hard as it can, and counts."""

    def __init__(self, size: int) -> None:
        self.size, self.asked = size, 0

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        self.asked += 1
        return np.ones(self.size, np.float32)


def test_a_policy_acts_on_when_the_recorded_actions_have_ended(failure):
    stage = VariantPlayer(read_bundle(failure))
    with closing(stage.env):
        sharp = Sharp(stage.env.action_size)
        early = stage.original.actions[:5]
        played = play(stage.env, stage.scene(stage.original), stage.original.seed, early, sharp)
    acted = actions_of(played.series)
    assert sharp.asked == len(acted) - 5 > 0
    np.testing.assert_array_equal(acted[:5], early)
    assert (acted[5:] == 1.0).all()


def test_a_run_that_learned_has_a_policy_and_one_that_did_not_has_none(run, tmp_path):
    learner = ["run", "--scenario", "low", "--method", "risk-sac", "--seed", "3", "--episodes", "9"]
    learner += ["--behaviour", "emergency"]
    subprocess.run([sys.executable, "-m", "risk_sac", *learner, "--out", tmp_path / "run"], check=True)
    results = read_results(tmp_path / "run")
    policy = policy_of(tmp_path / "run", results)
    assert policy is not None
    env = RiskSacEnv.of(results.spec)
    with closing(env):
        observation, _ = env.reset(seed=1)
        first, second = policy(observation), policy(observation)
    assert first.shape == (env.action_size,)
    np.testing.assert_array_equal(first, second)  # it does not explore
    assert policy_of(run, read_results(run)) is None
    assert policy_of(tmp_path / "run", replace(results, finished=False)) is None

    (bundle,) = bundles(tmp_path / "run", results, first_of_variants(results))
    write_bundle(tmp_path / "failure.npz", bundle)
    kept = read_bundle(tmp_path / "failure.npz")
    assert kept.policy is not None
    np.testing.assert_array_equal(kept.policy(observation), first)
    large = FrozenPolicy((np.zeros(MOST_POLICY_BYTES // 4 + 1, np.float32),), 2)
    manifest = bundle.manifest
    assert make_bundle(manifest.spec, manifest.episode, bundle.series, bundle.signal_heads, large).policy is None
    slower = EgoConfig(reaction_time_s=1.0)
    (found,) = regress_run(tmp_path / "run", slower)
    assert regress(kept, slower).case == found.case  # the policy acts on from a file as it does from the run
    (tmp_path / "run" / "checkpoint").unlink()
    assert policy_of(tmp_path / "run", results) is None
    with pytest.raises(ConfigError, match="has no checkpoint"):
        list(regress_run(tmp_path / "run", slower))
