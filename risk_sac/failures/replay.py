"""Episodes played once more, from their records and the actions that were recorded.

`python -m risk_sac.failures.replay FOLDER...` does it with the distinct failures of runs, and prints a line of JSON for
each run: a process in which nothing was searched before.
"""

import json
import sys
from contextlib import closing
from pathlib import Path

from risk_sac.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene, RiskSacError, SimulationError
from risk_sac.failures.play import play
from risk_sac.failures.trajectory import actions_of, trajectory_digest
from risk_sac.run_folder.results import FAILURES, read_results, series_name
from risk_sac.run_folder.series import read_series
from risk_sac.run_folder.verified import distinct_failures
from risk_sac.types import Scene


def _replay_all(folder: Path) -> list[int]:
    """The distinct failures of a run that are the same again."""
    results, same = read_results(folder), []
    with closing(RiskSacEnv.of(results.spec)) as env:
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


def _main(folders: list[Path]) -> None:
    for folder in folders:
        try:
            line = {"folder": str(folder), "same": _replay_all(folder)}
        except (RiskSacError, OSError, KeyError) as error:  # a key: of a series from before there was a release
            line = {"folder": str(folder), "error": f"{type(error).__name__}: {error}"}
        print(json.dumps(line), flush=True)  # noqa: T201 - to whoever started it


if __name__ == "__main__":
    _main([Path(argument) for argument in sys.argv[1:]])
