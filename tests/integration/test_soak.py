"""Episode after episode in one process; tests/benchmarks/bench_env.py plays 5,000."""

import subprocess
import sys

import pytest

EPISODES = 50


@pytest.mark.parametrize("family", ["low", "mixed", "dense"])
def test_fifty_biased_episodes_do_not_take_the_process_down(family: str) -> None:
    command = [sys.executable, "-m", "tests.soak", family, str(EPISODES)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.startswith("grew ")
