"""Episodes that crash the simulator, so that a run can go on without them.

libsumo lives in the process of the run: where it crashes, nothing here gets to act. So the run notes which episode it
is in, and Python's fault handler leaves a traceback behind when a fatal signal ends the process. A run that finds one
starts again from its checkpoint; an episode that has ended it FATAL times is left out.

crash.log     the newest traceback; empty while all is well
crashes.json  episode -> how often it has crashed
"""

import faulthandler
import json
import os
from pathlib import Path
from types import TracebackType
from typing import Self

LOG, COUNTS, CURRENT = "crash.log", "crashes.json", ".episode"
FATAL = 2  # the second time rules out that something else was to blame


class CrashGuard:
    """Knows which episodes of the run in a folder crash, and notes which one is being played."""

    def __init__(self, folder: Path) -> None:
        """Takes note of how the last process ended.

        Raises:
          OSError: the folder cannot be written.
        """
        self._counts = _counts(folder)
        self._others = faulthandler.is_enabled()
        self._log = (folder / LOG).open("wb")
        self._current = os.open(folder / CURRENT, os.O_CREAT | os.O_RDWR)

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
        """Notes that an episode begins; False if it is to be left out."""
        os.pwrite(self._current, f"{episode:12d}".encode(), 0)
        return self._counts.get(str(episode), 0) < FATAL


def _counts(folder: Path) -> dict[str, int]:
    """Crashes of each episode, with the one that ended the last process."""
    file, log = folder / COUNTS, folder / LOG
    counts: dict[str, int] = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    if log.exists() and log.stat().st_size:
        episode = (folder / CURRENT).read_text(encoding="utf-8").strip()
        counts[episode] = counts.get(episode, 0) + 1
        temporary = folder / f".{COUNTS}.tmp"
        temporary.write_text(json.dumps(counts), encoding="utf-8")
        temporary.replace(file)
    return counts
