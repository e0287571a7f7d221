"""What a worker tells the manager: one JSON object per line on the worker's standard output.

Non-finite numbers travel as the strings "Infinity", "-Infinity" and "NaN", so that every line is
strict JSON and nothing is lost; the API turns them into null.
"""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from risk_sac.types import EpisodeRecord, RunMetrics

FileName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]{0,199}$")]


class Message(BaseModel):
    """What all events share."""

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings", use_attribute_docstrings=True)


class Started(Message):
    """The worker has read its run and begins."""

    type: Literal["started"] = "started"
    pid: int


class EpisodeDone(Message):
    """An episode ended."""

    type: Literal["episode"] = "episode"
    record: EpisodeRecord
    metrics: RunMetrics
    """Of the episode's phase so far."""
    series: FileName | None
    """File of its full time series in the run's folder `failures`, if the ego touched something."""
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


class Failed(Message):
    """The run cannot go on."""

    type: Literal["failed"] = "failed"
    reason: str
    storage: bool = False
    """The disk refused, so sibling runs would fail too."""


Event = Annotated[Started | EpisodeDone | Finished | Failed, Field(discriminator="type")]

_EVENT: TypeAdapter[Event] = TypeAdapter(Event)


def encode(event: Event) -> bytes:
    """One line, newline included."""
    return event.model_dump_json().encode() + b"\n"


def decode(line: bytes) -> Event:
    """The event in one line.

    Raises:
      pydantic.ValidationError: the line holds no event.
    """
    return _EVENT.validate_json(line)
