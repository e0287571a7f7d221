"""Guard of a run against episodes that crash its process repeatedly."""

import faulthandler
import hashlib
import logging
import os
from pathlib import Path
from types import TracebackType
from typing import Self

from pydantic import BaseModel

from risk_sac.errors import DamagedError
from risk_sac.run_folder.durable import read_sealed, write_sealed

logger = logging.getLogger(__name__)

LOG, COUNTS, CURRENT = "crash.log", "crashes.json", ".episode"
FATAL = 2  # number of crashes at one place that rules out another cause
PATIENCE = 4  # number of crashes at several places that ends the run
EGO, BY_EGO = "ego, ", b"/egos/guard.py"  # of a place where the ego's code ran, whose stack has this file in it
RESET = -1  # number of the step while the scene is chosen and set up


class Crashes(BaseModel):
    """Content of crashes.json."""

    places: dict[int, list[str]] = {}  # by episode

    def fatal(self, episode: int) -> bool:
        """Whether an episode is to be left out."""
        places = self.places.get(episode, [])
        return len(places) >= PATIENCE or any(places.count(place) >= FATAL for place in set(places))


class CrashGuard:
    """Counter of a run's crashes, with the present episode's progress noted."""

    def __init__(self, folder: Path) -> None:
        """Counts a crash of the last process."""
        self._folder = folder
        self._crashes = _read(folder / COUNTS)
        self._playing: int | None = None
        traceback, note = _content(folder / LOG), _content(folder / CURRENT)
        (folder / LOG).write_bytes(b"")  # before the crash is counted: it may be missed, but never counts twice
        if traceback:
            self._count(traceback, note)
        self._others = faulthandler.is_enabled()
        self._log = (folder / LOG).open("wb")
        self._current = os.open(folder / CURRENT, os.O_CREAT | os.O_WRONLY | os.O_TRUNC)

    def __enter__(self) -> Self:
        faulthandler.enable(self._log, all_threads=False)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        faulthandler.disable()
        if self._others:
            faulthandler.enable(2)  # `sys.stderr` may have no descriptor, as in a notebook
        self._log.close()
        os.close(self._current)

    def begin(self, episode: int) -> bool:
        """Notes that an episode begins and the one before ended.

        Returns False if it is to be left out.
        """
        if self._playing is not None and self._crashes.places.pop(self._playing, []):
            self._write()  # it can be played to its end, so it was not to blame
        playable = not self._crashes.fatal(episode)
        self._playing = episode if playable else None
        self._note(episode, RESET)
        return playable

    def by_ego(self, episode: int) -> bool:
        """Whether an episode is left out because its ego crashed."""
        return any(place.startswith(EGO) for place in self._crashes.places.get(episode, []))

    def step(self, step: int) -> None:
        """Notes that a step of the episode begins."""
        if self._playing is not None:
            self._note(self._playing, step)

    def _note(self, episode: int, step: int) -> None:
        os.pwrite(self._current, f"{episode:12d} {step:8d}\n".encode(), 0)

    def _count(self, traceback: bytes, note: bytes) -> None:
        try:
            episode, step = map(int, note.split())
        except ValueError:
            logger.warning("%s holds %r, so a crash cannot be held against an episode", self._folder / CURRENT, note)
            return
        places = self._crashes.places.setdefault(episode, [])
        places.append(f"{EGO if BY_EGO in traceback else ''}step {step}, stack {_stack(traceback)}")
        self._write()
        logger.warning(
            "the process crashed in episode %d, step %d, which makes %d times:\n%s",
            *(episode, step, len(places), traceback.decode(errors="replace")),
        )

    def _write(self) -> None:
        write_sealed(self._folder / COUNTS, self._crashes)


def _read(file: Path) -> Crashes:
    """Reads the crashes so far; zero if damaged, since crashes repeat."""
    try:
        return read_sealed(file, Crashes)
    except FileNotFoundError:
        return Crashes()
    except DamagedError as error:
        logger.warning("crashes are counted from zero again: %s", error)
        return Crashes()


def _content(file: Path) -> bytes:
    return file.read_bytes() if file.exists() else b""


def _stack(traceback: bytes) -> str:
    """Returns a digest of Python frames, without addresses and thread numbers."""
    frames = [line for line in traceback.splitlines() if line.startswith(b"  File ")]
    return hashlib.sha256(b"\n".join(frames)).hexdigest()[:16]
