import subprocess
import sys
from pathlib import Path

import pytest

from risk_sac.run_folder.crash_guard import COUNTS, CURRENT, FATAL, LOG, PATIENCE, CrashGuard

# Episode 3 ends the process in its fifth step, by what the second argument says.
CRASH = """
import ctypes, os, sys
from pathlib import Path
from risk_sac.run_folder.crash_guard import CrashGuard
with CrashGuard(Path(sys.argv[1])) as guard:
    for episode in range(10):
        for step in range(20) if guard.begin(episode) else ():
            guard.step(step)
            if (episode, step) == (3, int(sys.argv[3])):
                exec(sys.argv[2])
"""
SEGFAULT = "ctypes.string_at(0)"  # reads address 0: a real segmentation fault, which no handler can survive
IN_EGO = f"from risk_sac.egos.guard import Guarded; Guarded(lambda: {SEGFAULT}, 60.0, foreign=True)"
KILL = "os.kill(os.getpid(), 9)"


def play(folder: Path, what: str = SEGFAULT, step: int = 5) -> int:
    command = [sys.executable, "-c", CRASH, str(folder), what, str(step)]
    return subprocess.run(command, capture_output=True).returncode


def playable(folder: Path) -> list[int]:
    with CrashGuard(folder) as guard:
        return [episode for episode in range(6) if guard.begin(episode)]


def test_an_episode_that_crashes_again_at_the_same_place_is_left_out_and_no_other(tmp_path):
    assert [play(tmp_path) for _ in range(FATAL)] == FATAL * [-11]
    assert play(tmp_path) == 0
    assert playable(tmp_path) == [0, 1, 2, 4, 5]


@pytest.mark.parametrize(("what", "by_ego"), [(IN_EGO, True), (SEGFAULT, False)])
def test_a_crash_in_the_ego_s_code_is_its_own(tmp_path, what, by_ego):
    assert [play(tmp_path, what) for _ in range(FATAL)] == FATAL * [-11]
    with CrashGuard(tmp_path) as guard:
        assert not guard.begin(3)
        assert guard.by_ego(3) is by_ego


def test_crashes_at_several_places_take_longer_to_convince(tmp_path):
    for step in range(PATIENCE):
        assert play(tmp_path, step=step) == -11
    assert play(tmp_path) == 0


def test_an_episode_that_was_played_to_its_end_was_not_to_blame(tmp_path):
    assert play(tmp_path) == -11
    assert play(tmp_path, "pass") == 0
    assert play(tmp_path) == -11
    assert playable(tmp_path) == [0, 1, 2, 3, 4, 5]


def test_a_run_that_was_killed_from_outside_has_not_crashed(tmp_path):
    for _ in range(PATIENCE):
        assert play(tmp_path, KILL) == -9
    assert not (tmp_path / COUNTS).exists()
    assert playable(tmp_path) == [0, 1, 2, 3, 4, 5]


def test_a_crash_counts_once_and_its_traceback_goes_to_the_log(tmp_path, caplog):
    play(tmp_path)
    assert playable(tmp_path) == [0, 1, 2, 3, 4, 5]
    assert "crashed in episode 3, step 5, which makes 1 times:\nFatal Python error: Segmentation fault" in caplog.text
    caplog.clear()
    assert playable(tmp_path) == [0, 1, 2, 3, 4, 5]
    assert not caplog.records


@pytest.fixture
def crashed(tmp_path):
    """Folder of a run with one counted crash and an uncounted one."""
    play(tmp_path)
    play(tmp_path)
    assert (tmp_path / COUNTS).exists()
    assert (tmp_path / LOG).read_bytes()
    return tmp_path


def test_damaged_counts_begin_at_zero_again(crashed, caplog):
    (crashed / COUNTS).write_bytes((crashed / COUNTS).read_bytes().replace(b"step 5", b"step 4"))
    assert playable(crashed) == [0, 1, 2, 3, 4, 5]
    assert f"crashes are counted from zero again: {crashed / COUNTS} is damaged" in caplog.text


def test_a_damaged_note_of_the_episode_leaves_out_no_other(crashed):
    before = {part: (crashed / part).read_bytes() for part in (LOG, COUNTS, CURRENT)}
    note = before[CURRENT]
    damages = [note[:length] for length in range(len(note))]
    damages += [note[:at] + bytes([note[at] ^ 1 << at % 8]) + note[at + 1 :] for at in range(len(note))]
    for damaged in damages:
        for part, content in (before | {CURRENT: damaged}).items():
            (crashed / part).write_bytes(content)
        assert set(playable(crashed)) >= {0, 1, 2, 4, 5}
