"""Violation without contact, of a user's requirement, in every use of failures."""

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image
from pyarrow import parquet

from risk_sac.cli import main
from risk_sac.failures.bundle import Bundle, read_bundle
from risk_sac.failures.export.formats import FormatName, export
from risk_sac.failures.export.gif import HOLD_MS
from risk_sac.failures.export.recorded import Recorded
from risk_sac.failures.minimise import minimise
from risk_sac.failures.recording import actions_of
from risk_sac.records import EpisodeRecord, Violation
from risk_sac.run_folder.results import first_of_variants, read_results
from tests.exports.test_mcap import read

SPEC = """
family: low
method: random
seed: 5
budget: {episodes: 8}
requirements: [{name: never_fast, formula: "ego_speed_mps <= 14.5", scale: 2}]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run whose ego breaks the requirement in several episodes, sometimes late."""
    folder = tmp_path_factory.mktemp("violations")
    (folder / "spec.yaml").write_text(SPEC)
    assert main(["run", "--spec", str(folder / "spec.yaml"), "--out", str(folder / "run")]) == 0
    return folder


def named(episode: EpisodeRecord) -> Violation:
    violation = episode.worst_violation
    assert isinstance(violation, Violation)
    return violation


@pytest.fixture(scope="module")
def failure(folder: Path) -> str:
    """Id of a failure that begins after the release."""
    valid = [each for each in read_results(folder / "run").failures if each.episode.valid_violations]
    return next(each.id for each in valid if named(each.episode).time_s > 0.5)


@pytest.fixture(scope="module")
def bundle(folder: Path, failure: str) -> Path:
    assert main(["bundle", str(folder / "run"), failure, "--out", str(folder / "failure.npz")]) == 0
    return folder / "failure.npz"


def test_it_is_listed_sorted_and_verified(folder, tell):
    _, out, _ = tell("show", folder / "run")
    assert "never_fast" in out
    _, out, _ = tell("clusters", folder / "run")
    assert "never_fast violated" in out
    status, out, _ = tell("verify", folder / "run", "--times", 1)
    assert status == 0
    distinct = len(first_of_variants(read_results(folder / "run")))
    assert f"{distinct} of {distinct} failure" in out


def test_it_is_drawn_beside_its_twin(folder, failure, tell):
    assert tell("show", folder / "run", failure, "--out", folder / "a.png")[0] == 0
    assert tell("show", folder / "run", failure, "--twin", "idle", "--out", folder / "b.png")[0] == 0
    assert (folder / "b.png").stat().st_size > (folder / "a.png").stat().st_size > 10_000


def test_a_bundle_of_it_is_played_to_the_horizon_to_the_bit(bundle, tell):
    found = read_bundle(bundle)
    status, out, _ = tell("replay", bundle)
    assert status == 0
    assert f"the ego {named(found.manifest.episode).event}" in out
    assert "every array is as recorded" in out
    assert len(actions_of(found.series)) == 150


@pytest.mark.usefixtures("steering_egos")
def test_an_ego_that_keeps_the_requirement_has_fixed_it_and_its_own_still_fails(bundle, tell):
    status, out, _ = tell("regress", "--failures", bundle, "--ego", "default")
    assert (status, "1 still failing" in out, "violates never_fast after" in out) == (1, True, True)
    status, out, _ = tell("regress", "--failures", bundle, "--ego", "crawler")
    assert (status, "1 fixed" in out, "violates never_fast" in out) == (0, True, False)


def test_its_core_fails_by_the_same_requirement_with_less(bundle, tell, tmp_path):
    minimal = minimise(read_bundle(bundle), most=40)
    core = minimal.manifest.core
    assert core is not None
    assert core.after.segments < core.before.segments
    assert core.held == core.copies
    assert named(minimal.manifest.episode).requirement == "never_fast"
    assert core.sentence.endswith("violates never_fast")
    assert len(actions_of(minimal.series)) == 150  # so that it is played like any other


@pytest.mark.parametrize("near", [True, False], ids=["an actor near", "nobody near"])
def test_every_format_has_the_violation_with_and_without_an_actor(bundle, *, near):
    found = read_bundle(bundle) if near else alone(read_bundle(bundle))
    recorded = Recorded.of(found)
    violation = recorded.violation
    assert recorded.moment == pytest.approx((recorded.released_s + violation.time_s) * 10)
    assert recorded.moment < recorded.frames - 1
    files = {name: export(name, recorded) for name in FormatName if name != "parquet"}
    for name in ("sumo", "openscenario", "commonroad"):
        told = json.loads(files[FormatName(name)]["beside.json"])
        assert told["episode"]["violations"][0]["requirement"] == "never_fast"
    assert json.loads(files[FormatName.SUMO]["commands.json"])["striker"] == violation.other_id
    ((_, gif),) = files[FormatName.GIF].items()
    picture, lasts_ms = Image.open(io.BytesIO(gif)), []
    for frame in range(picture.n_frames):
        picture.seek(frame)
        lasts_ms.append(picture.info["duration"])
    assert lasts_ms.index(HOLD_MS) == len(lasts_ms) - 1 - 20  # two seconds before the end
    ((_, mcap),) = files[FormatName.MCAP].items()
    moments = [message.message for _, message in read(mcap)[0]["/moments"]]
    assert moments[0] == "the adversaries are released"
    assert moments[-1].startswith(f"the ego {violation.event}: ")


def alone(bundle: Bundle) -> Bundle:
    """The same, as if nothing had been in the ego's way."""
    episode = bundle.manifest.episode
    nobody = {"other_id": None, "other_kind": None, "other_body": None, "other_role": None}
    violations = (named(episode).model_copy(update=nobody), *episode.violations[1:])
    changed = episode.model_copy(update={"violations": violations})
    return replace(bundle, manifest=bundle.manifest.model_copy(update={"episode": changed}))


def test_the_table_of_episodes_has_requirements_and_violations(folder, tell, tmp_path):
    assert tell("export", folder / "run", "--format", "parquet", "--out", tmp_path / "a.parquet")[0] == 0
    rows = parquet.read_table(tmp_path / "a.parquet").to_pylist()
    failed = [row for row in rows if row["failed"] == ["never_fast"]]
    recorded = read_results(folder / "run").failures  # those that the ego inherited, too
    assert len(failed) == sum(bool(each.episode.valid_violations) for each in recorded) > 1
    assert all(row["violations"][0]["requirement"] == "never_fast" for row in failed)
