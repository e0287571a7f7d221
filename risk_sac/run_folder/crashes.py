"""Episodes that crash the simulator, so that a run can go on without them.

libsumo lives in the process of the run: where it crashes, nothing here gets to act. So the run notes how far it is,
and Python's fault handler leaves a traceback behind when a fatal signal ends the process. A run that finds one starts
again from its checkpoint. Episodes are deterministic, so one that crashes the simulator does so at the same place
every time: the second time it is left out. A crash elsewhere in it may have come from outside, or from memory that
was spoilt earlier; of those it takes more, in a row.

A process that was killed (SIGKILL, by the kernel when memory runs out, say) leaves no traceback, and that is not held
against the episode: who starts the process again decides when to give up.

crash.log     the newest traceback; empty while all is well
crashes.json  episode -> the places where it has crashed since it was last played to its end; sealed
.episode      the episode and step being played, with a checksum
"""

import faulthandler
import hashlib
import logging
import os
import zlib
from pathlib import Path
from types import TracebackType
from typing import Self

from pydantic import BaseModel, ConfigDict, ValidationError

from risk_sac.errors import DamagedError
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.seal import seal, unseal

logger = logging.getLogger(__name__)

LOG, COUNTS, CURRENT = "crash.log", "crashes.json", ".episode"
FATAL = 2  # crashes at one place: the second time rules out that something else was to blame
PATIENCE = 4  # crashes at several places
RESET = -1  # the step while the scene is chosen and set up


class Crashes(BaseModel):
    """What crashes.json says."""

    model_config = ConfigDict(extra="forbid")
    places: dict[int, list[str]] = {}  # by episode

    def fatal(self, episode: int) -> bool:
        """Whether an episode is to be left out."""
        places = self.places.get(episode, [])
        return len(places) >= PATIENCE or any(places.count(place) >= FATAL for place in set(places))


class CrashGuard:
    """Knows which episodes of the run in a folder crash, and notes how far the one being played is."""

    def __init__(self, folder: Path) -> None:
        """Takes note of how the last process ended.

        Raises:
          OSError: the folder cannot be written.
        """
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
            faulthandler.enable()
        self._log.close()
        os.close(self._current)

    def begin(self, episode: int) -> bool:
        """Notes that an episode begins, so the one before is over; False if it is to be left out."""
        if self._playing is not None and self._crashes.places.pop(self._playing, []):
            self._write()  # it can be played to its end, so it was not to blame
        playable = not self._crashes.fatal(episode)
        self._playing = episode if playable else None
        self._note(episode, RESET)
        return playable

    def step(self, step: int) -> None:
        """Notes that a step of the episode begins."""
        if self._playing is not None:
            self._note(self._playing, step)

    def _note(self, episode: int, step: int) -> None:
        os.pwrite(self._current, _noted(episode, step), 0)

    def _count(self, traceback: bytes, note: bytes) -> None:
        where = _where(note)
        if where is None:
            logger.warning("%s holds %r, so a crash cannot be held against an episode", self._folder / CURRENT, note)
            return
        episode, step = where
        places = self._crashes.places.setdefault(episode, [])
        places.append(f"step {step}, stack {_stack(traceback)}")
        self._write()
        logger.warning(
            "the process crashed in episode %d, step %d, which makes %d times:\n%s",
            *(episode, step, len(places), traceback.decode(errors="replace")),
        )

    def _write(self) -> None:
        replace_file(self._folder / COUNTS, seal(self._crashes.model_dump_json(indent=2).encode()))


def _read(file: Path) -> Crashes:
    """Crashes so far; none if the file is damaged, since an episode to blame will crash again."""
    try:
        return Crashes.model_validate_json(unseal(file.read_bytes()))
    except FileNotFoundError:
        return Crashes()
    except (DamagedError, ValidationError) as error:
        logger.warning("%s is damaged, so crashes are counted anew: %s", file, error)
        return Crashes()


def _content(file: Path) -> bytes:
    return file.read_bytes() if file.exists() else b""


def _noted(episode: int, step: int) -> bytes:
    text = f"{episode:12d}{step:8d}"
    return f"{text} {zlib.crc32(text.encode()):08x}".encode()


def _where(note: bytes) -> tuple[int, int] | None:
    """Episode and step of a note; None if it is damaged."""
    try:
        episode, step = int(note[:12]), int(note[12:20])
    except ValueError:
        return None
    return (episode, step) if note == _noted(episode, step) else None


def _stack(traceback: bytes) -> str:
    """A name for what Python was doing; addresses and thread numbers differ from process to process."""
    frames = [line for line in traceback.splitlines() if line.startswith(b"  File ")]
    return hashlib.sha256(b"\n".join(frames)).hexdigest()[:16]
