"""Timing calls against each other on a machine that others use too."""

import time
from collections.abc import Callable

import numpy as np

from risk_sac.types import Floats


def interleaved(
    *calls: Callable[[], object],
    rounds: int,
    repeats: int = 1,
    clock: Callable[[], float] = time.perf_counter,
) -> Floats:
    """Seconds of each call, `rounds x calls`, the calls taking turns so that they meet the same machine."""
    seconds = np.empty((rounds, len(calls)))
    for row in seconds:
        for column, call in enumerate(calls):
            started = clock()
            for _ in range(repeats):
                call()
            row[column] = (clock() - started) / repeats
    return seconds
