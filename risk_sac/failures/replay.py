"""Episodes played once more, from their records and the actions that were recorded.

`python -m risk_sac.failures.replay TIMES JOBS FOLDER...` does it with the distinct failures of runs, `TIMES` over, each
time in a process of its own, `JOBS` of them at once. Each prints a line of JSON for each run. In the process that
they are forked from nothing was searched and SUMO was never started. It has read the libraries, once for all of them,
which costs more than what is played.
"""

import json
import multiprocessing
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from risk_sac.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene, RiskSacError, SimulationError
from risk_sac.failures.play import play
from risk_sac.failures.trajectory import actions_of, trajectory_digest
from risk_sac.risk.soft_min import soft_min
from risk_sac.run_folder.results import FAILURES, Results, read_results, series_name
from risk_sac.run_folder.series import read_series
from risk_sac.run_folder.verified import distinct_failures
from risk_sac.types import Scene


def _same(folder: Path, results: Results, env: RiskSacEnv) -> list[int]:
    """The distinct failures of a run that are the same again."""
    same = []
    for episode in distinct_failures(results):
        recorded = read_series(folder / FAILURES / series_name(episode.index))
        try:
            scene = Scene(env.problem.family.name, episode.scene)
            again = play(env, scene, episode.seed, actions_of(recorded)).series
        except (InfeasibleScene, SimulationError):
            continue
        if trajectory_digest(again) == trajectory_digest(recorded):
            same.append(episode.index)
    return same


Prepared = Mapping[Path, tuple[Results, RiskSacEnv]]


def _prepared(folders: Sequence[Path]) -> Prepared:
    """The runs that can be played here; of each other one a line says why not, such as that its ego is not there."""
    found = {}
    for folder in folders:
        results = read_results(folder)
        try:
            found[folder] = results, RiskSacEnv.of(results.spec)
        except RiskSacError as error:
            _say(folder, error=f"{type(error).__name__}: {error}")
    return found


def _say(folder: Path, **told: object) -> None:
    """Tells whoever started it, in one write: several processes share the output, and `print` may end a line later."""
    os.write(sys.stdout.fileno(), f"{json.dumps({'folder': str(folder)} | told)}\n".encode())


def _tell(runs: Prepared) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for folder, (results, env) in runs.items():
        try:
            with closing(env):
                _say(folder, same=_same(folder, results, env))
        except (RiskSacError, OSError, KeyError) as error:  # a key: of a series from before there was a release
            _say(folder, error=f"{type(error).__name__}: {error}")


def _main(times: int, jobs: int, folders: list[Path]) -> int:
    """The greatest exit status of the processes."""
    runs = _prepared(folders)
    soft_min(np.zeros(1), 1.0)  # the first call of any compiled function loads what all of them need
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))  # and daemons end with their parent's exit
    fork, statuses = multiprocessing.get_context("fork"), [0]
    for first in range(0, times, jobs):
        processes = [
            fork.Process(target=_tell, args=(runs,), daemon=True) for _ in range(first, min(first + jobs, times))
        ]
        for process in processes:
            process.start()
        for process in processes:
            process.join()
            statuses.append(abs(process.exitcode or 0))
    return max(statuses)


if __name__ == "__main__":
    times, jobs, *folders = sys.argv[1:]
    sys.exit(_main(int(times), int(jobs), [Path(folder) for folder in folders]))
