"""Whether failures repeat: a failure that does not is nobody's time worth."""

import json
import logging
import subprocess
import sys
from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from risk_sac.run_folder.results import read_results
from risk_sac.run_folder.verified import Repetition, Verified, distinct_failures, read_verified, write_verified

logger = logging.getLogger(__name__)

TIMES = 3  # by default


def verify(folders: Sequence[Path], times: int = TIMES, jobs: int = 1) -> Mapping[Path, Verified]:
    """Replays the distinct failures of finished runs, each in `times` fresh processes, and notes what came of it.

    What was verified as often before is not replayed again. Should a process crash or be interrupted, nothing is noted.

    Args:
      folders: of the runs.
      times: how often.
      jobs: processes at a time.

    Raises:
      ConfigError: a folder holds no run.
      OSError: a folder cannot be written.
    """
    found: dict[Path, Verified] = {}
    missing: dict[Path, Verified] = {}  # with nothing replayed yet
    for folder in folders:
        results = read_results(folder)
        if results.digest is None:
            continue
        known = read_verified(folder, results.digest)
        if known is not None and all(repetition.times >= times for repetition in known.episodes.values()):
            found[folder] = known
        else:
            episodes = {episode.index: Repetition(times=0, same=0) for episode in distinct_failures(results)}
            missing[folder] = Verified(digest=results.digest, episodes=episodes)
    if failed := [folder for folder, verified in missing.items() if verified.episodes]:
        with ThreadPoolExecutor(jobs) as threads:
            for same in threads.map(_same, [failed] * times):
                if same is None:
                    return found
                for folder in failed:
                    missing[folder] = _counted(missing[folder], same[folder])
    for folder, verified in missing.items():
        write_verified(folder, verified)
    return found | missing


def _counted(verified: Verified, same: set[int]) -> Verified:
    """With one more replay, of which these episodes were the same."""
    episodes = {
        index: Repetition(times=before.times + 1, same=before.same + (index in same))
        for index, before in verified.episodes.items()
    }
    return Verified(digest=verified.digest, episodes=episodes)


def _same(folders: Sequence[Path]) -> Mapping[Path, set[int]] | None:
    """The failures that were the same in a fresh process; None if it was interrupted or crashed."""
    command = [sys.executable, "-m", "risk_sac.failures.replay", *map(str, folders)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if ended.returncode != 0:
        logger.warning("replaying failures ended with status %d: %s", ended.returncode, ended.stderr[-2000:])
        return None
    same: defaultdict[Path, set[int]] = defaultdict(set)
    for line in map(json.loads, ended.stdout.splitlines()):
        if line["same"]:
            same[Path(line["folder"])].add(line["index"])
    return same
