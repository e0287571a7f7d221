"""Episodes played once more, from their records and the actions that were recorded.

`python -m risk_sac.failures.replay FILE TIMES JOBS FOLDER...` replays the first failures of each variant `TIMES` over,
each time in a process of its own, `JOBS` of them at once. Each appends a line of JSON for each run to the file. They
are forked from a process that has read the libraries, which costs more than playing, but has never started SUMO.
"""

import json
import multiprocessing
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene, RiskSacError, SimulationError
from risk_sac.failures.play import replay
from risk_sac.failures.recording import trajectory_digest
from risk_sac.records import EpisodeRecord
from risk_sac.risk.measures import soft_min
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, RunResults, first_of_variants, read_results, series_name

ATTEMPTS = 3
Prepared = Mapping[Path, tuple[RunResults, RiskSacEnv]]


def _prepared(file: Path, folders: Sequence[Path]) -> Prepared:
    """Opens the runs that can be played here.

    For each other run a line states why not, such as an ego that is not installed.
    """
    prepared = {}
    for folder in folders:
        results = read_results(folder)
        try:
            prepared[folder] = results, RiskSacEnv.of(results.spec)
        except RiskSacError as error:
            _say(file, {"folder": str(folder), "error": f"{type(error).__name__}: {error}"})
    return prepared


def _say(file: Path, *lines: dict[str, object]) -> None:
    """Appends lines in one write, since several processes share the file and any may be killed."""
    with file.open("ab", buffering=0) as output:
        output.write("".join(f"{json.dumps(line)}\n" for line in lines).encode())


def _tell(file: Path, runs: Prepared) -> None:
    """Replays the first failures of each variant of all runs, and says of each run which are the same again."""
    lines = list[dict[str, object]]()
    for folder, (results, env) in runs.items():
        try:
            with closing(env):
                same = [each.index for each in first_of_variants(results) if _repeats(folder, each, env)]
            lines.append({"folder": str(folder), "same": same})
        except (RiskSacError, OSError) as error:
            lines.append({"folder": str(folder), "error": f"{type(error).__name__}: {error}"})
    _say(file, *lines)


def _repeats(folder: Path, episode: EpisodeRecord, env: RiskSacEnv) -> bool:
    recorded = read_series(folder / FAILURES / series_name(episode.index))
    try:
        return trajectory_digest(replay(env, episode, recorded).series) == trajectory_digest(recorded)
    except (InfeasibleScene, SimulationError):
        return False


def _main(file: Path, times: int, jobs: int, folders: list[Path]) -> int:
    """The greatest exit status of the processes; one that was killed is replaced, up to `ATTEMPTS` times."""
    runs = _prepared(file, folders)
    soft_min(np.zeros(1), 1.0)  # the first call of any compiled function loads what all of them need
    fork, statuses = multiprocessing.get_context("fork"), [0]
    left, lost = times, 0
    while left:
        processes = [fork.Process(target=_tell, args=(file, runs)) for _ in range(min(jobs, left))]
        for process in processes:
            process.start()
        for process in processes:
            process.join()
            killed = (process.exitcode or 0) < 0 and lost < ATTEMPTS
            lost += killed
            left -= not killed
            statuses.append(0 if killed else abs(process.exitcode or 0))
    return max(statuses)


if __name__ == "__main__":
    file, times, jobs, *folders = sys.argv[1:]
    sys.exit(_main(Path(file), int(times), int(jobs), [Path(folder) for folder in folders]))
