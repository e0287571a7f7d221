"""Episodes played once more, from their records and the actions that were recorded.

`python -m risk_sac.failures.replay FOLDER...` does it with the distinct failures of runs, and prints a line of JSON for
each: a process of its own, so that nothing is left of whatever was played before.
"""

import hashlib
import json
import sys
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene, SimulationError
from risk_sac.records import EpisodeRecord
from risk_sac.run_folder.results import FAILURES, read_results, series_name
from risk_sac.run_folder.series import read_series
from risk_sac.run_folder.verified import distinct_failures
from risk_sac.types import Floats, Scene

Series = Mapping[str, NDArray[Any]]


def actions_of(series: Series) -> Floats:
    """The actions since the release, `T x a`."""
    actions = series["actions"]
    released = int(np.searchsorted(series["time_s"], series["released_s"]))
    return actions[released + 1 :]


def replayed(env: RiskSacEnv, episode: EpisodeRecord, actions: Floats) -> Series:
    """The series of an episode that is played again, up to where the actions end.

    Raises:
      InfeasibleScene, SimulationError: it does not even begin as it did.
    """
    env.reset(seed=episode.seed, options={"scene": Scene(env.problem.family.name, episode.scene)})
    for action in actions:
        env.step(action)
    return env.trace.series()


def trajectory_digest(series: Series) -> str:
    """SHA-256 over the names, types, shapes and bytes of all arrays, however they were compressed."""
    digest = hashlib.sha256()
    for name in sorted(series):
        array = np.ascontiguousarray(series[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _main(folders: list[Path]) -> Iterator[dict[str, object]]:
    for folder in folders:
        results = read_results(folder)
        with closing(RiskSacEnv.of(results.spec)) as env:
            for episode in distinct_failures(results):
                recorded = read_series(folder / FAILURES / series_name(episode.index))
                try:
                    again = replayed(env, episode, actions_of(recorded))
                    same = trajectory_digest(again) == trajectory_digest(recorded)
                except (InfeasibleScene, SimulationError):
                    same = False
                yield {"folder": str(folder), "index": episode.index, "same": same}


if __name__ == "__main__":
    for line in _main([Path(argument) for argument in sys.argv[1:]]):
        print(json.dumps(line), flush=True)  # noqa: T201 - to whoever started it
