"""The learner's whole update beside Stable-Baselines3's `train`, replay sampling included in both."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from risk_sac.config import LearnerConfig
from risk_sac.types import Floats

ROOT = Path(__file__).parents[2]
CORES = len(os.sched_getaffinity(0))
DEFAULT = LearnerConfig().agent


def measured(threads: int, width: int, batch: int) -> Floats:
    """Seconds of theirs, ours and the matrix products alone, `rounds x 3`."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks.sac_update", str(width), str(batch)],
        env={**os.environ, "OMP_NUM_THREADS": str(threads), "MKL_NUM_THREADS": str(threads)},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return np.array(json.loads(done.stdout))


@pytest.mark.bench
@pytest.mark.parametrize(
    ("threads", "width", "batch", "wanted"),
    [(1, 256, 256, 1.6), (2, 256, 256, 1.9), (1, DEFAULT.hidden_sizes[0], DEFAULT.batch_size, 1.6)],
)
def test_an_update_is_faster_than_that_of_stable_baselines3(
    threads: int, width: int, batch: int, wanted: float
) -> None:
    if threads > CORES:
        pytest.skip(f"{threads} threads need {threads} cores; this process may use {CORES}")
    seconds = measured(threads, width, batch)
    ratios = seconds[:, 0] / seconds[:, 1]
    low, ratio, high = np.percentile(ratios, (25, 50, 75))
    theirs, ours, products = 1e3 * np.median(seconds, axis=0)
    print(
        f"\nSAC update, hidden {width}-{width}, batch {batch}, {threads} {'thread' if threads == 1 else 'threads'}: "
        f"{ours:.2f} ms {'CPU' if threads == 1 else 'wall'} time, Stable-Baselines3 {theirs:.2f} ms; "
        f"{ratio:.2f} times as fast (half of the rounds {low:.2f} to {high:.2f}); "
        f"its matrix products alone {products:.2f} ms"
    )
    assert ratio >= wanted
