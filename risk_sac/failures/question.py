"""Questions about a failure for the simulator, posed by processes without it."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.failures.export.formats import FormatName
from risk_sac.records import NO_CONTACT, Collision, EpisodeRecord, Record, Violation
from risk_sac.run_folder.arrays import unpack_arrays

IDLE = "idle"
Twin = Literal["idle", "default", "perfect", "careful", "defensive"]
"""What may be changed in a scene's twin: no attack, or the profile of another ego."""
Subject = Literal["bundle", "core", "most-plausible", "region", "twin", "export"]
REFUSED = 3  # exit status; the answer is why, in words
TOLD = "twin"  # name in a twin's file, beside the arrays of the time series


class Question(Record):
    """One question of one failure."""

    subject: Subject
    spec: RunSpec
    episode: EpisodeRecord
    series: Path
    """File of its time series."""
    twin: EgoConfig | None = None
    """The other ego of a twin; null: no attack."""
    format: FormatName | None = None
    """Of an export, which."""


class TwinPlay(Record):
    """Change to a scene, and its outcome."""

    changed: str
    """Such as "no attack"."""
    outcome: str
    """Such as "no contact"."""
    collision: Collision | None
    """The ego's first contact, if it touched something."""

    @classmethod
    def of(
        cls,
        ego: EgoConfig | None,
        failure: Collision | Violation,
        violations: Sequence[Collision | Violation],
        name: str = "",
    ) -> Self:
        """Describes a twin with another ego, or without an attack (None).

        `violations` are the twin's.
        """
        changed = "no attack" if ego is None else f"ego: {name or ego.name}"
        kept = "no contact" if failure.requirement == NO_CONTACT else f"keeps {failure.requirement}"
        violated = {each.requirement: each.event for each in violations}
        told = dict.fromkeys([failure.requirement, *violated], kept) | violated
        collision = next((each for each in violations if isinstance(each, Collision)), None)
        return cls(changed=changed, outcome=", ".join(told.values()), collision=collision)

    @property
    def title(self) -> str:
        """Of its picture."""
        return f"{self.changed}: {self.outcome}"


def twin_bytes(play: TwinPlay, series: Mapping[str, NDArray[Any]]) -> bytes:
    """A twin with its time series as an .npz."""
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **series, **{TOLD: np.array(play.model_dump_json())})
    return file.getvalue()


def read_twin(content: bytes) -> tuple[TwinPlay, dict[str, NDArray[Any]]]:
    """A twin and its time series from what `twin_bytes` wrote."""
    arrays = unpack_arrays(content)
    return TwinPlay.model_validate_json(str(arrays.pop(TOLD))), arrays
