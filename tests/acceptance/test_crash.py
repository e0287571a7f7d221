"""A run whose simulator dies in the same episode again and again comes to its end all the same."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from risk_sac.run_folder.crashes import FATAL

# The second episode reads address 0 in its eighth step, in libsumo's process, as a crash in libsumo does.
RISK_SAC = """
import ctypes, os, sys
import risk_sac.train  # once for all processes
from risk_sac import cli
from risk_sac.run_folder.crashes import CrashGuard

note = CrashGuard.step

def step(self, step):
    note(self, step)
    if (self._playing, step) == (1, 7):
        ctypes.string_at(0)

CrashGuard.step = step
for _ in range(int(sys.argv[1])):
    process = os.fork()
    if process == 0:
        sys.exit(cli.main(sys.argv[2:]))
    print(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), file=sys.stderr)
"""


@pytest.mark.torture  # the suite has it happen in the service: tests/integration/test_campaigns.py
def test_the_episode_is_left_out_and_counted(tmp_path: Path) -> None:
    command = ["run", "--family", "low", "--method", "random", "--episodes", "3", "--out", str(tmp_path / "run")]
    told = subprocess.run([sys.executable, "-c", RISK_SAC, str(FATAL + 1), *command], capture_output=True, text=True)
    ends = [line for line in told.stderr.splitlines() if line.lstrip("-").isdecimal()]
    assert ends == [*FATAL * ["-11"], "0"], told.stderr
    records = [json.loads(line) for line in (tmp_path / "run" / "episodes.jsonl").read_text().splitlines()]
    assert [record["index"] for record in records] == [0, 1, 2]
    assert (records[1]["outcome"], records[1]["reason"], records[1]["steps"]) == ("rejected", "sim_crash", 0)
    assert records[2]["steps"] > 0
    assert "Segmentation fault" not in (tmp_path / "run" / "crash.log").read_text()  # the last process went well
