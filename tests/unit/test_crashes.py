import json
import subprocess
import sys
from pathlib import Path

from risk_sac.crashes import COUNTS, FATAL, CrashGuard

CRASH = """
import ctypes, sys
from pathlib import Path
from risk_sac.crashes import CrashGuard
with CrashGuard(Path(sys.argv[1])) as guard:
    for episode in range(10):
        if guard.begin(episode) and episode == 3:
            ctypes.string_at(0)  # reads address 0: a real segmentation fault, which no handler can survive
"""


def play(folder: Path) -> int:
    return subprocess.run([sys.executable, "-c", CRASH, str(folder)], capture_output=True, timeout=60).returncode


def test_an_episode_that_crashes_again_is_left_out_and_no_other(tmp_path: Path) -> None:
    assert [play(tmp_path) for _ in range(FATAL)] == FATAL * [-11]
    assert play(tmp_path) == 0
    assert json.loads((tmp_path / COUNTS).read_text()) == {"3": FATAL}
    with CrashGuard(tmp_path) as guard:
        assert [guard.begin(episode) for episode in (2, 3, 4)] == [True, False, True]


def test_a_run_that_was_killed_from_outside_has_not_crashed(tmp_path: Path) -> None:
    kill = CRASH.replace("ctypes.string_at(0)", "import os; os.kill(os.getpid(), 9)")
    for _ in range(FATAL + 1):
        assert subprocess.run([sys.executable, "-c", kill, str(tmp_path)], timeout=60).returncode == -9
    assert not (tmp_path / COUNTS).exists()
    with CrashGuard(tmp_path) as guard:
        assert guard.begin(3)


def test_a_run_that_went_well_leaves_nothing_to_count(tmp_path: Path) -> None:
    for _ in range(FATAL + 1):
        with CrashGuard(tmp_path) as guard:
            assert guard.begin(0)
