"""Replays failures to find those that do not repeat."""

import json
import logging
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from risk_sac.errors import ConfigError
from risk_sac.execution.helper import ANSWER, run_helper
from risk_sac.failures.bundle import code_digest, versions
from risk_sac.records import Repetition
from risk_sac.run_folder.results import Results, read_results, write_results
from risk_sac.run_folder.verified import (
    TIMES,
    Verified,
    distinct_failures,
    read_verified,
    with_headline,
    write_verified,
)

logger = logging.getLogger(__name__)


def verify(
    folders: Sequence[Path], times: int = TIMES, jobs: int = 1, stopping: Callable[[], bool] = lambda: False
) -> Mapping[Path, Verified]:
    """Replays the distinct failures of finished runs, each in `times` processes, and notes what came of it.

    Each run's results.json then has its headline failures.

    What was verified as often before, by the same code, is not replayed again. Of a run whose series cannot be read
    nothing is noted, and of none whose replay was interrupted; the log says so.

    `jobs` replay at a time, until `stopping`. Returns what is noted, by folder.

    Raises:
      ConfigError: a folder holds no run, or `times` is not positive.
      OSError: a folder cannot be written.
    """
    if times < 1:
        raise ConfigError("times", f"{times}", "at least 1")
    code, found, runs = code_digest(), dict[Path, Verified](), dict[Path, Results]()
    missing: dict[Path, Verified] = {}  # with nothing replayed yet
    for folder in folders:
        results = runs[folder] = read_results(folder)
        if results.digest is None:
            continue
        known = read_verified(folder, results.digest)
        enough = known is not None and all(repetition.times >= times for repetition in known.episodes.values())
        if known is not None and enough and known.code == code and known.versions == versions():
            found[folder] = known
        else:
            episodes = {episode.index: Repetition(times=0, same=0) for episode in distinct_failures(results)}
            missing[folder] = Verified(digest=results.digest, code=code, versions=versions(), episodes=episodes)
    failed = [folder for folder, verified in missing.items() if verified.episodes]
    told = _replayed(failed, times, max(jobs, 1), stopping) if failed else {}
    for folder in failed:
        if len(told[folder]) >= times:  # more, if a process was killed after it had told of this run
            same = {
                index: Repetition(times=times, same=sum(index in each for each in told[folder][:times]))
                for index in missing[folder].episodes
            }
            missing[folder] = replace(missing[folder], episodes=same)
        else:
            del missing[folder]
    for folder, verified in missing.items():
        write_verified(folder, verified)
    for folder, verified in (found | missing).items():
        results = with_headline(runs[folder], verified)
        if results != runs[folder]:
            write_results(folder, results)
    return found | missing


def _replayed(
    folders: Sequence[Path], times: int, jobs: int, stopping: Callable[[], bool]
) -> Mapping[Path, Sequence[Collection[int]]]:
    """By run, the failures that were the same, for each process that has replayed it to the end."""
    arguments = [ANSWER, str(times), str(jobs), *map(str, folders)]
    result = run_helper("risk_sac.failures.replay", arguments, wall_s=math.inf, stopping=stopping)
    if result.status != 0:
        logger.warning("replaying failures ended with status %d: %s", result.status, result.log)
    lines = [json.loads(line) for line in result.answer.splitlines(keepends=True) if line.endswith(b"\n")]
    for line in lines:
        if "error" in line:
            logger.warning("the failures of %s cannot be replayed: %s", line["folder"], line["error"])
    return {
        folder: [line["same"] for line in lines if line["folder"] == str(folder) and "same" in line]
        for folder in folders
    }
