"""Bundles of failures, replayed elsewhere; and files that are no bundles."""

import hashlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sumo_nets
from risk_sac.cli import main
from risk_sac.errors import ConfigError
from risk_sac.failures import bundle as bundles
from risk_sac.failures.bundle import MANIFEST, read_bundle
from risk_sac.failures.recording import trajectory_digest
from risk_sac.run_folder.arrays import MOST_ARRAYS, MOST_BYTES
from risk_sac.run_folder.results import read_results
from risk_sac.scenario import library

RUN = ["--scenario", "dense", "--method", "random", "--seed", "1", "--episodes", "20"]
NET = Path(sumo_nets.__path__[0]) / "dense" / "dense.net.xml"
Arrays = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bundle of a run's first contact; the run's folder has moved."""
    folder = tmp_path_factory.mktemp("bundle")
    assert main(["run", *RUN, "--out", str(folder / "run")]) == 0
    contact = read_results(folder / "run").failures[0]
    assert main(["bundle", str(folder / "run"), contact.id, "--out", str(folder / "failure.npz")]) == 0
    (folder / "run").rename(folder / "elsewhere")
    return folder / "failure.npz"


def test_a_fresh_process_elsewhere_plays_it_again_to_the_bit(bundle, tmp_path):
    shutil.copy(bundle, tmp_path)
    command = [sys.executable, "-m", "risk_sac", "replay", bundle.name]
    told = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    collision = read_bundle(bundle).manifest.episode.collision
    assert collision is not None
    said = f"the ego {collision.event}; every array is as recorded"
    assert said in told.stdout.replace("\n", " ")


def test_it_holds_every_signal_head_of_every_frame_since_the_release(bundle):
    found = read_bundle(bundle)
    frames = int((found.series["time_s"] >= found.series["released_s"]).sum())
    assert len(found.signal_heads) == frames
    assert found.signal_heads.shape[1] >= 4
    assert set(found.signal_heads.tobytes()) <= set(b"rRyYgGuoOs")


def test_show_draws_it_without_its_run_and_takes_no_number(bundle, tmp_path, tell):
    file = Path(shutil.copy(bundle, tmp_path))
    status, out, _ = tell("show", file)
    assert (status, "failure.png" in out) == (0, True)
    assert (tmp_path / "failure.png").read_bytes().startswith(b"\x89PNG")
    status, _, err = tell("show", file, "8")
    assert (status, "a bundle holds one failure" in err) == (2, True)
    file.write_bytes(file.read_bytes()[:-9])
    status, _, err = tell("show", file)
    assert (status, "is no bundle that can be played" in err) == (2, True)


def changed(bundle: Path, file: Path, change: Callable[[Arrays], None]) -> Path:
    with np.load(bundle) as archive:
        arrays = {name: archive[name] for name in archive.files}
    change(arrays)
    np.savez_compressed(file, **arrays)
    return file


def manifest(arrays: Arrays, **changes: Any) -> None:
    arrays[MANIFEST] = np.array(json.dumps(json.loads(str(arrays[MANIFEST])) | changes))


def episode(arrays: Arrays, **changes: Any) -> None:
    manifest(arrays, episode=json.loads(str(arrays[MANIFEST]))["episode"] | changes)


def series(arrays: Arrays, **changes: np.ndarray | None) -> None:
    """Changes arrays, or takes them out, and the digest with them."""
    arrays |= changes
    for name in [name for name, values in arrays.items() if values is None]:
        del arrays[name]
    kept = {name: values for name, values in arrays.items() if name not in (MANIFEST, "signal_heads")}
    manifest(arrays, digest=trajectory_digest(kept))


def test_other_actions_are_noticed(bundle, tmp_path, tell):
    def steer(arrays: Arrays) -> None:
        turned = arrays["actions"].copy()
        turned[-8:] *= -1.0
        series(arrays, actions=turned)

    status, out, _ = tell("replay", changed(bundle, tmp_path / "a.npz", steer))
    assert status == 1
    assert "not as recorded" in out


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda arrays: arrays["x_m"].__imul__(2.0), "is damaged: its arrays do not have the digest"),
        (lambda arrays: manifest(arrays, format=4), "a manifest of another version, or none: format"),
        (lambda arrays: manifest(arrays, spec={"family": "low"}), "a manifest of another version, or none: spec"),
        (lambda arrays: manifest(arrays, world={}), "was found on another dense/dense.net.xml"),
        (lambda arrays: arrays.pop(MANIFEST), "lacks manifest"),
        (lambda arrays: episode(arrays, seed=-1), "is no bundle that can be played: seed -1"),
        (lambda arrays: episode(arrays, script=[0.5] * 3), "is no bundle that can be played: a script of 3 genes"),
        (lambda arrays: episode(arrays, scene={"friction": 1.0}), "is no bundle that can be played: scene"),
        (lambda arrays: series(arrays, actions=None), "is no bundle that can be played: actions is missing"),
        (lambda arrays: series(arrays, actions=np.full((9, 99), 0.5)), "no bundle that can be played: actions of"),
        (lambda arrays: series(arrays, actions=arrays["actions"] * np.nan), "is no bundle that can be played: act"),
        (lambda arrays: series(arrays, time_s=np.zeros((2, 2))), "is no bundle that can be played: times"),
        (lambda arrays: arrays.update(policy_layer_0=np.zeros((2, 2))), "no bundle that can be played: a policy of"),
        (lambda arrays: arrays.update(policy_layer_7=np.zeros((2, 2))), "is no bundle that can be played"),
        (lambda arrays: arrays.update({f"a{i}": np.zeros(1) for i in range(MOST_ARRAYS)}), "wanted at most"),
    ],
    ids=[
        *("damaged", "newer", "another spec", "another net", "no manifest"),
        *("another seed", "another script", "another scene"),
        *("no actions", "wide actions", "no numbers", "times in a square", "no policy", "half a policy", "many arrays"),
    ],
)
def test_what_cannot_be_replayed_is_refused_in_one_line(change, complaint, bundle, tmp_path, tell):
    status, out, err = tell("replay", changed(bundle, tmp_path / "a.npz", change))
    assert status == 2
    assert complaint in err
    assert not out


def array(shape: tuple[int, ...], content: bytes) -> bytes:
    """One in numpy's format with the shape that it says it has."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": shape})
    return stream.getvalue() + content


def pickled() -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.array([{}], dtype=object), allow_pickle=True)
    return stream.getvalue()


def zipped(*contents: bytes, packed: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with warnings.catch_warnings(action="ignore"), zipfile.ZipFile(file, "w", packed) as archive:
        for content in contents:
            archive.writestr("x_m.npy", content)
    return file.getvalue()


def larger_than_it_is(claimed: int) -> bytes:
    """An archive whose entry claims to have so many bytes."""
    content = bytearray(zipped(bytes(100)))
    entry = content.rindex(b"PK\x01\x02")
    content[entry + 24 : entry + 28] = claimed.to_bytes(4, "little")
    return bytes(content)


ONE = array((1,), bytes(8))


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (lambda: b"", "is no bundle"),
        (lambda: b"\x89PNG\r\n", "is no bundle"),
        (lambda: zipped(b"no array"), "is no bundle"),
        (lambda: zipped(array((10**11,), bytes(8))), "is no bundle"),
        (lambda: zipped(array((0, 10**30), b"")), "is no bundle"),
        (lambda: zipped(ONE[:10] + b"{[]: 1}".ljust(len(ONE) - 19) + b"\n" + bytes(8)), "is no bundle"),
        (lambda: zipped(pickled()), "is no bundle"),
        (lambda: zipped(ONE, packed=zipfile.ZIP_LZMA), "x_m.npy is packed in another way"),
        (lambda: zipped(ONE, packed=zipfile.ZIP_BZIP2), "x_m.npy is packed in another way"),
        (lambda: larger_than_it_is(MOST_BYTES + 1), "wanted at most"),
        (lambda: bytes(MOST_BYTES + 1), "is larger than"),
    ],
    ids=[
        *("empty", "a picture", "no array", "a lying header", "an endless shape", "a header that is none", "pickled"),
        *("lzma", "bzip2", "a bomb", "large"),
    ],
)
def test_hostile_files_are_refused_in_one_line(content, complaint, tmp_path, tell):
    (tmp_path / "a.npz").write_bytes(content())
    status, out, err = tell("replay", tmp_path / "a.npz")
    assert status == 2
    assert complaint in err
    assert not out


@pytest.mark.parametrize("seed", range(4))
def test_a_flipped_bit_is_noticed_or_makes_no_difference(seed, bundle, tmp_path):
    content = bytearray(bundle.read_bytes())
    content[int(np.random.default_rng(seed).integers(len(content)))] ^= 1 << seed
    (tmp_path / "a.npz").write_bytes(content)
    try:
        found = read_bundle(tmp_path / "a.npz")
    except ConfigError:
        return
    assert found.manifest == read_bundle(bundle).manifest


def test_a_failure_that_does_not_repeat_gets_no_bundle(bundle, tmp_path, monkeypatch, tell):
    run = bundle.parent / "elsewhere"
    contact = read_results(run).failures[0]
    monkeypatch.setattr("risk_sac.failures.play.actions_of", lambda series: series["actions"][-3:])
    status, _, err = tell("bundle", run, contact.id, "--out", tmp_path / "a.npz")
    assert status == 1
    assert "does not repeat here" in err
    assert not (tmp_path / "a.npz").exists()


NET_ARRAY = f"{bundles.SCENARIO}net.xml"


@pytest.fixture(scope="module")
def placed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bundle of a contact on a user's map without its places' library."""
    folder = tmp_path_factory.mktemp("placed")
    net = ["--network", str(NET), "--pattern", "junction", "--place", "from_west"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(library.VARIABLE, str(folder / "places"))
        assert main(["run", *net, *RUN[2:], "--out", str(folder / "run")]) == 0
        contact = read_results(folder / "run").failures[0]
        assert main(["bundle", str(folder / "run"), contact.id, "--out", str(folder / "failure.npz")]) == 0
    shutil.rmtree(folder / "places")
    return folder / "failure.npz"


def replayed_elsewhere(file: Path, folder: Path) -> "subprocess.CompletedProcess[str]":
    """In a process that has an empty library of places."""
    command = [sys.executable, "-m", "risk_sac", "replay", str(file)]
    elsewhere = os.environ | {library.VARIABLE: str(folder / "places")}
    return subprocess.run(command, cwd=folder, env=elsewhere, capture_output=True, text=True)


def test_a_failure_on_a_map_is_played_again_where_nobody_has_the_map(placed, tmp_path):
    told = replayed_elsewhere(placed, tmp_path)
    assert told.returncode == 0, told.stderr
    assert "every array is as recorded" in told.stdout.replace("\n", " ")
    assert len(list((tmp_path / "places").iterdir())) == 1


def without_scenario(arrays: Arrays) -> None:
    for name in (NET_ARRAY, f"{bundles.SCENARIO}{library.DOCUMENT}"):
        arrays.pop(name)


def repack(arrays: Arrays, net: bytes) -> None:
    """Forges another net under a name that has its digest."""
    text = arrays[f"{bundles.SCENARIO}{library.DOCUMENT}"].tobytes()
    arrays[NET_ARRAY] = np.frombuffer(net, dtype=np.uint8)
    files = {"net.xml": net, library.DOCUMENT: text}
    content = b"".join(f"{name}\0{len(files[name])}\0".encode() + files[name] for name in files)
    digest = hashlib.sha256(content).hexdigest()[: library.DIGITS]
    spec = json.loads(str(arrays[MANIFEST]))["spec"] | {"family": f"junction_{digest}"}
    manifest(arrays, spec=spec)


@pytest.mark.parametrize(
    ("inside", "says"),
    [
        ('<tlLogic id="t"><param key="file" value="/tmp/x"/></tlLogic>', "its net has a <param>"),
        ('<include href="/etc/passwd"/>', "its net has a <include>"),
        ('<type id="${HOME}"/>', "says $"),
        ("</edge>", "cannot be played: mismatched tag"),
    ],
)
def test_a_carried_net_that_says_more_than_roads_reaches_nobody(placed, tmp_path, monkeypatch, inside, says):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path / "places"))
    file = changed(placed, tmp_path / "a.npz", lambda arrays: repack(arrays, f"<net>{inside}</net>".encode()))
    with pytest.raises(ConfigError, match=re.escape(says)):
        read_bundle(file)
    assert not (tmp_path / "places").exists()


def test_a_bundle_that_lost_its_place_or_carries_another_is_refused(placed, tmp_path, monkeypatch):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path / "places"))
    told = replayed_elsewhere(changed(placed, tmp_path / "a.npz", without_scenario), tmp_path)
    assert (told.returncode, "which is no scenario" in told.stderr.replace("\n", " ")) == (2, True), told.stderr
    doctype = np.frombuffer(b"<!DOCTYPE net [<!ENTITY a 'b'>]><net/>", dtype=np.uint8)
    with pytest.raises(ConfigError, match="DTD"):
        read_bundle(changed(placed, tmp_path / "b.npz", lambda arrays: arrays.update({NET_ARRAY: doctype})))
    other = np.frombuffer(b"<net/>", dtype=np.uint8)
    with pytest.raises(ConfigError, match="whose digest is another"):
        read_bundle(changed(placed, tmp_path / "c.npz", lambda arrays: arrays.update({NET_ARRAY: other})))
