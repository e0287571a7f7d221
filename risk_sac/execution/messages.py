"""Messages and logs of a worker: one JSON object per line.

Every line is strict JSON from which nothing is lost: words are written as `risk_sac.records.Record` writes them.
"""

import os
import re
import signal
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import ConfigDict, Field, TypeAdapter

from risk_sac.records import EpisodeRecord, Record, Repetition, RunMetrics

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
FileName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]{0,199}$")]


class Message(Record):
    """Base of all messages."""

    model_config = ConfigDict(extra="forbid")


class Started(Message):
    """The worker has read its run and begins."""

    type: Literal["started"] = "started"
    pid: int


class Heartbeat(Message):
    """The worker lives; sent about every second, whatever else it does."""

    type: Literal["heartbeat"] = "heartbeat"


class EpisodeDone(Message):
    """An episode ended."""

    type: Literal["episode"] = "episode"
    record: EpisodeRecord
    metrics: RunMetrics
    """Of the episode's phase so far."""
    series: FileName | None
    """File of its full time series in the run's folder `failures`, if the ego touched something."""
    series_sha256: Sha256 | None = None
    """SHA-256 of that file, as it was written."""
    wall_s: float
    """Wall time since the previous event, s."""


class Finished(Message):
    """The run ended in order."""

    type: Literal["finished"] = "finished"
    finished: bool
    """False: it was asked to stop and can be resumed."""
    metrics: RunMetrics
    evaluation: RunMetrics | None
    digest: str
    versions: Mapping[str, str]
    wall_s: float
    repetitions: Mapping[int, Repetition] = {}
    """Of the distinct failures, by index of the episode; none where nothing was replayed."""
    flaky: Mapping[int, tuple[str, ...]] = {}
    """Requirements whose violations are of a kind that does not repeat, by index of the episode; the metrics count
    these violations as refused."""


class Failed(Message):
    """The run cannot go on."""

    type: Literal["failed"] = "failed"
    reason: str
    storage: bool = False
    """The disk refused, so sibling runs would fail too."""


Event = Started | EpisodeDone | Finished | Failed
"""What becomes of a run."""

_WORD: TypeAdapter[Event | Heartbeat] = TypeAdapter(Annotated[Event | Heartbeat, Field(discriminator="type")])


@dataclass(frozen=True, slots=True)
class Heard:
    """A line of a worker, understood."""

    word: Event | None  # to be passed on; None for a mere sign of life
    progress: bool = False  # it has finished an episode
    last: bool = False  # it has no more to say, and is to leave


def encode(word: Event | Heartbeat) -> bytes:
    """One line, newline included."""
    return word.model_dump_json().encode() + b"\n"


def decode(line: bytes) -> Event | Heartbeat:
    """Parses one line.

    Raises:
      pydantic.ValidationError: it says nothing that a worker may say.
    """
    return _WORD.validate_json(line)


def hear(line: bytes) -> Heard:
    """Parses one line of a worker for an executor.

    Raises:
      pydantic.ValidationError: it says nothing that a worker may say; it is a ValueError.
    """
    word = decode(line)
    if isinstance(word, Heartbeat):
        return Heard(None)
    return Heard(word, progress=isinstance(word, EpisodeDone), last=isinstance(word, Finished | Failed))


TAIL_BYTES = 2000  # of a log, at most
TAIL_LINES = 5

# Of an absolute path; URLs stay. No path is deeper, and without a bound a log made for it takes minutes.
_FOLDERS = re.compile(r"""(?<![\w./:])/(?:[^\s/'"|]+/){0,30}(?=[\w.])""")
_SIGNAL_NAMES = {item.value: item.name for item in signal.Signals}  # real-time signals have none


@dataclass(frozen=True, slots=True)
class WorkerLog:
    """The part of a run's log that one worker wrote."""

    path: Path
    start: int  # byte at which it begins

    def tail(self) -> str:
        """Its last lines, in one."""
        try:
            with self.path.open("rb") as stream:
                size = stream.seek(0, os.SEEK_END)
                stream.seek(max(self.start, size - TAIL_BYTES))
                lines = stream.read().decode(errors="replace").splitlines()
        except OSError as error:
            return f"its log cannot be read ({error.strerror})"
        said = " | ".join(line.strip() for line in lines[-TAIL_LINES:] if line.strip())
        return without_folders(said, self.path.parent) or "it left no message"


def reason_of(status: int, log: WorkerLog) -> str | None:
    """Describes an exit status, negative for a signal; None for 0."""
    if status < 0:
        return f"worker was killed by {_SIGNAL_NAMES.get(-status, f'signal {-status}')}"
    if status > 0:
        return f"worker exited with status {status}: {log.tail()}"
    return None


def without_folders(text: str, own: Path | None = None) -> str:
    """Removes the folders from all paths in a text.

    Args:
      text: as it was meant for the log.
      own: the folder that it is about, which may be a relative path.
    """
    if own is not None:
        text = text.replace(f"{own}/", "").replace(str(own), own.name)
    return _FOLDERS.sub("", text)
