"""The learner's whole update beside Stable-Baselines3's `train`, replay sampling included in both."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from risk_sac.config import LearnerConfig
from tests.benchmarks.timing import Times

ROOT = Path(__file__).parents[2]
DEFAULT = LearnerConfig().agent


def measured(width: int, batch: int) -> Times:
    """Theirs and ours."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks.sac_update", str(width), str(batch)],
        env={**os.environ, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return Times(**{name: np.array(rows) for name, rows in json.loads(done.stdout).items()})


@pytest.mark.bench
@pytest.mark.parametrize(("width", "wanted"), [(DEFAULT.hidden_sizes[0], 1.3), (256, 1.2)])
def test_an_update_is_faster_than_that_of_stable_baselines3(width: int, wanted: float) -> None:
    times = measured(width, DEFAULT.batch_size)
    # Processor time, which neighbours lengthen least.
    low, ratio, high = np.percentile(times.cpu_s[:, 0] / times.cpu_s[:, 1], (25, 50, 75))
    theirs, ours = 1e3 * np.median(times.cpu_s, axis=0)
    print(
        f"\nSAC update, hidden {width}-{width}, batch {DEFAULT.batch_size}, one thread: {ours:.2f} ms CPU time,"
        f" Stable-Baselines3 {theirs:.2f} ms; {ratio:.2f} times as fast"
        f" (half of {len(times.cpu_s)} rounds {low:.2f} to {high:.2f})"
    )
    assert ratio >= wanted
