"""Failed exports and refusing disks: a clear error, and nothing half-written."""

import json
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import sumo_nets
from risk_sac.cli import main
from risk_sac.failures.bundle import MANIFEST
from risk_sac.failures.export import formats
from risk_sac.failures.export.formats import FORMATS, FormatName
from tests.exports.make_examples import FOLDER, example

BUNDLE = FOLDER / "low.npz"


def refused(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> str:
    assert main(["export", *map(str, arguments)]) == 2
    return capsys.readouterr().err.replace("\n", " ")


def test_a_format_that_cannot_hold_it_names_those_that_can(tmp_path, capsys):
    assert "since gif holds one" in refused(capsys, tmp_path, "--format", "gif", "--out", tmp_path / "x.gif")
    assert "got 2 bundles" in refused(capsys, BUNDLE, BUNDLE, "--format", "gif", "--out", tmp_path / "x.gif")
    assert not list(tmp_path.iterdir())
    with pytest.raises(
        formats.ConfigError, match="no single failure; wanted one of: sumo, openscenario, commonroad, mcap, gif"
    ):
        formats.check_carries(FormatName.PARQUET, "failure")


def test_a_missing_package_names_the_extra_before_anything_is_read(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(formats, "find_spec", lambda name: None)
    asked = (tmp_path / "none.npz", "--out", tmp_path / "x", "--format")
    assert "needs foxglove, and that is not installed; pip install 'risk-sac[export]'" in refused(
        capsys, *asked, "mcap"
    )
    assert [name for name, row in FORMATS.items() if not row.missing] == [
        FormatName.SUMO,
        FormatName.COMMONROAD,
        FormatName.GIF,
    ]


@pytest.mark.parametrize("name", ["gif", "openscenario", "sumo"])
def test_a_net_that_is_gone_or_another_one_is_named(name, tmp_path, capsys, monkeypatch):
    nets = tmp_path / "nets"
    shutil.copytree(Path(sumo_nets.__path__[0]), nets)
    monkeypatch.setattr("risk_sac.failures.bundle.files", lambda package: nets)
    net, asked = nets / "low" / "low.net.xml", (BUNDLE, "--format", name, "--out", tmp_path / "x")
    net.write_bytes(net.read_bytes() + b"\n")
    assert "was found on another low/low.net.xml" in refused(capsys, *asked)
    net.unlink()
    assert "low/low.net.xml, which low-" in refused(capsys, *asked)
    assert not (tmp_path / "x").exists()


def test_a_bundle_that_lacks_an_array_or_a_violation_is_refused(tmp_path, capsys):
    from risk_sac.failures.recording import trajectory_digest

    with np.load(BUNDLE) as archive:
        arrays = {name: archive[name] for name in archive.files}
    told = json.loads(str(arrays[MANIFEST]))
    series = {name: values for name, values in arrays.items() if name not in (MANIFEST, "signal_heads", "visible")}
    changed = told | {"digest": trajectory_digest(series)}
    np.savez(tmp_path / "a.npz", **series, signal_heads=arrays["signal_heads"], manifest=np.array(json.dumps(changed)))
    asked = (tmp_path / "a.npz", "--format", "mcap", "--out", tmp_path / "x.mcap")
    assert "has no sound array visible" in refused(capsys, *asked)
    untouched = told | {"episode": told["episode"] | {"collision": None}}
    np.savez(tmp_path / "a.npz", **arrays | {MANIFEST: np.array(json.dumps(untouched))})
    assert "keeps every requirement" in refused(capsys, *asked)
    assert not (tmp_path / "x.mcap").exists()


def small_disk() -> None:
    """Limits files of this process to 20 kB, as a full disk."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))


@pytest.mark.parametrize(("name", "out"), [("openscenario", "folder"), ("sumo", "x.zip"), ("gif", "x.gif")])
def test_a_disk_that_fills_leaves_nothing(name, out, tmp_path):
    command = [sys.executable, "-m", "risk_sac", "export", BUNDLE, "--format", name, "--out", tmp_path / "new" / out]
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=small_disk)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "File too large" in done.stderr or "cannot be written" in done.stderr
    assert not list(tmp_path.glob("new/*"))


def test_a_folder_with_something_in_it_is_left_alone(tmp_path, capsys):
    (tmp_path / "kept").write_text("mine")
    said = refused(capsys, BUNDLE, "--format", "openscenario", "--out", tmp_path)
    assert "which exists" in said
    assert [file.name for file in tmp_path.iterdir()] == ["kept"]


def test_an_export_is_the_same_file_each_time(tmp_path, exported):
    for name in ("openscenario", "commonroad", "mcap", "gif"):
        out = example(FormatName(name))
        again = tmp_path / out.name
        assert main(["export", str(BUNDLE), "--format", name, "--out", str(again)]) == 0
        assert again.read_bytes() == out.read_bytes(), f"{out.name} is not what is exported now: `make examples`"
