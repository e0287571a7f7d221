"""Timing calls against each other on a machine that others use too."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from risk_sac.world.types import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Times:
    """What each call took in each round."""

    wall_s: Floats  # rounds x calls
    cpu_s: Floats  # rounds x calls, of all threads together


def interleaved(*calls: Callable[[], object], rounds: int, repeats: int = 1) -> Times:
    """Times the calls by turns; each time is the mean of `repeats`."""
    times = Times(wall_s=np.empty((rounds, len(calls))), cpu_s=np.empty((rounds, len(calls))))
    for turn in np.ndindex(times.wall_s.shape):
        call = calls[turn[1]]
        started, started_cpu = time.perf_counter(), time.process_time()
        for _ in range(repeats):
            call()
        times.wall_s[turn] = (time.perf_counter() - started) / repeats
        times.cpu_s[turn] = (time.process_time() - started_cpu) / repeats
    return times
