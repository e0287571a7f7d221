"""Runs an audit on every core, part by part, so that the same call goes on where another was stopped."""

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

from risk_sac.audit.controls import CONTROLS, IDLE, Control
from risk_sac.audit.play import Played, play
from risk_sac.config import FamilyName
from risk_sac.run_folder.durable import replace_file

PART = 50  # episodes a process plays at a time
_PLAYED = TypeAdapter(list[Played])


@dataclass(frozen=True, slots=True)
class Part:
    """Some episodes of one control in one family."""

    family: FamilyName
    control: Control
    first: int
    count: int

    @property
    def file(self) -> str:
        """Its results, below the audit's folder."""
        name = "".join(letter if letter.isalnum() else "-" for letter in self.control.name)
        return f"{self.family}/{name}/{self.first:06d}-{self.count}.json"


def parts_of(families: Sequence[FamilyName], episodes: int, idle_episodes: int) -> list[Part]:
    """What an audit consists of.

    Args:
      families: of scenes.
      episodes: of each rung of the ladder and of the control without adversaries.
      idle_episodes: in which all actions are 0.
    """
    return [
        Part(family, control, first, min(PART, total - first))
        for family in families
        for control in CONTROLS
        for total in (idle_episodes if control is IDLE else episodes,)
        for first in range(0, total, PART)
    ]


def run(parts: Sequence[Part], folder: Path, seed: int, jobs: int, done: Callable[[int, int], None]) -> None:
    """Plays what the folder does not hold yet.

    Args:
      parts: what to play.
      folder: gets a file for each part.
      seed: of scenes, actions and SUMO.
      jobs: processes at a time.
      done: told how many parts of how many are there.

    Raises:
      BrokenProcessPool: a process died; the same call goes on with the other parts.
    """
    missing = [part for part in parts if not (folder / part.file).exists()]
    done(len(parts) - len(missing), len(parts))
    spawn = multiprocessing.get_context("spawn")  # libsumo does not survive a fork
    with ProcessPoolExecutor(jobs, mp_context=spawn) as pool:
        futures = {pool.submit(play, part.family, part.control, seed, part.first, part.count): part for part in missing}
        for count, future in enumerate(as_completed(futures), start=1):
            file = folder / futures[future].file
            file.parent.mkdir(parents=True, exist_ok=True)
            replace_file(file, _PLAYED.dump_json(future.result()))
            done(len(parts) - len(missing) + count, len(parts))


def read(parts: Sequence[Part], folder: Path, family: FamilyName, control: Control) -> list[Played]:
    """The episodes of a control, in order; those of parts that are not there are left out."""
    files = [folder / part.file for part in parts if part.family == family and part.control == control]
    return [played for file in files if file.exists() for played in _PLAYED.validate_json(file.read_bytes())]
