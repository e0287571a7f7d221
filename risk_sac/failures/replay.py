"""Episodes played once more, from their records and the actions that were recorded.

`python -m risk_sac.failures.replay FOLDER...` does it with the distinct failures of runs, and prints a line of JSON for
each run: a process in which nothing was searched before.
"""

import hashlib
import json
import sys
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene, RiskSacError, SimulationError
from risk_sac.records import Collision, EpisodeRecord
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay:
    """An episode that was played again, up to where the actions ended."""

    series: Series
    signal_heads: NDArray[np.uint8]  # T since the release x heads, SUMO's letters
    collision: Collision | None


def replay(env: RiskSacEnv, episode: EpisodeRecord, actions: Floats) -> Replay:
    """Plays an episode again.

    Raises:
      InfeasibleScene, SimulationError: it does not even begin as it did.
    """
    _, info = env.reset(seed=episode.seed, options={"scene": Scene(env.problem.family.name, episode.scene)})
    heads = [env.signal_heads()]
    for action in actions:
        *_, info = env.step(action)
        heads.append(env.signal_heads())
    letters = np.frombuffer(b"".join(heads), dtype=np.uint8).reshape(len(heads), -1)
    return Replay(series=env.trace.series(), signal_heads=letters, collision=info.get("collision"))


def trajectory_digest(series: Series) -> str:
    """SHA-256 over the names, types, shapes and bytes of all arrays, however they were compressed."""
    digest = hashlib.sha256()
    for name in sorted(series):
        array = np.ascontiguousarray(series[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _replay_all(folder: Path) -> list[int]:
    """The distinct failures of a run that are the same again."""
    results, same = read_results(folder), []
    with closing(RiskSacEnv.of(results.spec)) as env:
        for episode in distinct_failures(results):
            recorded = read_series(folder / FAILURES / series_name(episode.index))
            try:
                again = replay(env, episode, actions_of(recorded)).series
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
