import errno
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from risk_sac.errors import ConfigError
from risk_sac.run_folder import durable
from risk_sac.run_folder.durable import held, remove_temporaries, scratch_folder

HOLD = """
import sys
from risk_sac.run_folder.durable import scratch_folder
with scratch_folder() as folder:
    (folder / "file").touch()
    print(folder, flush=True)
    sys.stdin.read()
"""


def test_what_a_killed_process_left_goes_and_nothing_else_does(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    others = [tmp_path / name for name in ("risk-sac-results", "risk-sac.0123456789abcdef", "tmpabc")]
    for folder in others:
        folder.mkdir()
    command = [sys.executable, "-c", HOLD]
    processes = [subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) for _ in range(2)]
    dead, alive = (Path(process.stdout.readline().decode().strip()) for process in processes if process.stdout)
    processes[0].kill()
    processes[0].communicate()
    with scratch_folder() as own:
        assert set(tmp_path.iterdir()) == {*others, alive, own}
        assert (alive / "file").exists()
    processes[1].communicate()
    assert set(tmp_path.iterdir()) == set(others)
    assert not dead.exists()


def test_only_our_half_written_files_of_before_are_removed(tmp_path):
    ours = [
        ".results.json.tmp",
        "failures/.000012.npz.tmp",
        "studies/.000012-core.json.tmp",
        "regressions/.c1-0123456789abcdef.json.tmp",
        ".checkpoint.tmp",
        ".keys.json.tmp",
    ]
    others = ["results.json", ".notes.tmp", "results.json.tmp", "checkpoint", "failures/.x.npz.tmp", ".lock"]
    for name in (*ours, *others):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    remove_temporaries(tmp_path, time.time() - 3600)  # they are younger, so their writers may live
    assert all((tmp_path / name).exists() for name in (*ours, *others))
    remove_temporaries(tmp_path, time.time() + 1)
    assert {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()} == set(others)


def test_a_folder_is_held_by_one_process_at_a_time(tmp_path):
    with held(tmp_path / "run"):
        with pytest.raises(ConfigError, match="in which another process is at work"), held(tmp_path / "run"):
            pass
        with held(tmp_path / "other"):
            pass
    with held(tmp_path / "run"):
        pass


@pytest.mark.parametrize(
    ("number", "told"), [(13, "which cannot be written .Permission denied"), (30, "Read-only file system")]
)
def test_a_folder_that_cannot_be_written_is_named(tmp_path, monkeypatch, number, told):
    monkeypatch.setattr(durable, "lock", refusing(number))
    with pytest.raises(ConfigError, match=told), held(tmp_path):
        pass


def test_a_folder_without_locks_is_used_and_the_log_says_so(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(durable, "lock", refusing(37))
    with held(tmp_path):
        pass
    assert "cannot be locked (No locks available)" in caplog.text


def refusing(number: int):
    def lock(path: Path) -> None:
        raise OSError(number, os.strerror(number), str(path))

    return lock


def test_a_temporary_folder_needs_no_locks(monkeypatch):
    def refuse(handle, how):
        raise OSError(errno.EBADF, "a network's file system locks no folder")

    monkeypatch.setattr("fcntl.flock", refuse)
    with scratch_folder() as one, scratch_folder() as other:
        assert one.is_dir()
        assert other.is_dir()
