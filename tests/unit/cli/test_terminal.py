"""Whatever the terminal takes, a command runs and ends with its own status."""

import io
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from risk_sac import cli
from risk_sac.terminal import prepare_streams

EGOS = f"{sys.executable} -m risk_sac egos list"
KEYS = f"{sys.executable} -m service.keys list"
COMMA = """
import locale, sys
from contextlib import closing
from risk_sac.env import make_default

locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")
with closing(make_default("low")) as env:
    env.reset(seed=1)
    for _ in range(5):
        env.step(env.action_space.sample())
print(locale.localeconv()["decimal_point"])
"""


@pytest.mark.parametrize(
    ("command", "environment"),
    [
        (EGOS, {"PYTHONIOENCODING": "ascii", "COLUMNS": "20", "TERM": "dumb"}),
        (EGOS, {"PYTHONIOENCODING": "latin-1", "LC_ALL": "C"}),
        (f"{EGOS} | true; exit ${{PIPESTATUS[0]}}", {}),
        (f"{EGOS} >&- 2>&- <&-", {}),
    ],
)
def test_a_command_ends_well_whatever_reads_its_output(command: str, environment: dict[str, str]) -> None:
    done = subprocess.run(["bash", "-c", command], env=os.environ | environment, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize("command", [EGOS, KEYS])
def test_a_full_disk_behind_the_output_is_one_line_and_a_failure(command: str, tmp_path: Path) -> None:
    environment = os.environ | {"RISK_SAC_DATA_DIR": str(tmp_path)}
    done = subprocess.run(
        ["bash", "-c", f"{command} > /dev/full"], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    assert done.stderr.count("\n") == 1


def test_letters_that_a_terminal_lacks_are_written_in_ascii(monkeypatch: pytest.MonkeyPatch) -> None:
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, encoding="ascii"))
    prepare_streams()
    sys.stdout.write("contacts 3 → valid 2 … λ ≤ 1, Straße \ud800")
    sys.stdout.flush()
    assert written.getvalue() == b"contacts 3 -> valid 2 ... lambda <= 1, Stra?e ?"


@pytest.mark.parametrize(
    ("end", "status", "said"),
    [
        (SystemExit(0), 1, "ended the program"),
        (MemoryError(), 1, "too little memory"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (OSError(28, "No space left on device", "out/results.json"), 1, "out/results.json: No space left on device"),
    ],
)
def test_however_a_command_ends_its_status_says_that_it_is_not_done(
    end: BaseException, status: int, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def ending(options: object) -> int:
        raise end

    monkeypatch.setattr("risk_sac.cli.egos._list", ending)
    assert cli.main(["egos", "list"]) == status
    complaint = capsys.readouterr().err
    assert said in complaint
    assert complaint.count("\n") == 1


@pytest.mark.skipif(shutil.which("localedef") is None, reason="no localedef to make a locale with")
def test_a_decimal_comma_of_the_process_does_not_reach_the_simulator(tmp_path: Path) -> None:
    made = subprocess.run(
        ["localedef", "-i", "de_DE", "-f", "UTF-8", str(tmp_path / "de_DE.UTF-8")], capture_output=True, check=False
    )
    if not (tmp_path / "de_DE.UTF-8").exists():
        pytest.skip(f"no sources of locales: {made.stderr.decode()}")
    environment = os.environ | {"LOCPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", COMMA], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, ",\n"), done.stderr
