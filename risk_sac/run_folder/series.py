"""Time series of an episode: collected while played, written after a violation."""

import hashlib
import io
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from risk_sac.records import SeriesFile
from risk_sac.risk.measures import Measures
from risk_sac.risk.publish import AHEAD, ENCOUNTER, GAP, RSS_LATERAL, RSS_LONGITUDINAL, SEEN, TTC
from risk_sac.risk.rss import TTC_CAP_S
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.run_folder.durable import replace_file
from risk_sac.verdicts.evidence import PER_ACTOR as MOTION
from risk_sac.world.types import Frame

PER_ACTOR = (*MOTION, "link")
ON_THE_MOVE_MPS = 1.0
PER_OTHER = {  # rows of an assessment
    "distance_m": GAP,
    "ttc_s": TTC,
    "rss_longitudinal_m": RSS_LONGITUDINAL,
    "rss_lateral_m": RSS_LATERAL,
    "visible": SEEN,
}


@dataclass(slots=True)
class Trace:
    """Frames, measures and actions of an episode; `series` builds the arrays."""

    requirements: tuple[str, ...]
    frames: list[Frame] = field(default_factory=list)
    measures: list[Measures] = field(default_factory=list)
    actions: list[Sequence[float]] = field(default_factory=list)  # one for each frame after the release

    @property
    def released(self) -> int:
        """Index of the frame at which the adversaries were released."""
        return len(self.frames) - 1 - len(self.actions)

    @property
    def since_release(self) -> list[Measures]:
        """Of that frame and those that followed."""
        return self.measures[self.released :]

    @property
    def min_ttc_s(self) -> float:
        """Smallest TTC since the release; the cap where nothing was played."""
        return min((m.signals["ttc_s"] for m in self.since_release), default=TTC_CAP_S)

    @property
    def min_robustness(self) -> float:
        """Smallest soft-min robustness since the release; the cap where nothing was played."""
        return min((m.soft_min for m in self.since_release), default=ROBUSTNESS_CLIP)

    def encounters_s(self, actors: Collection[str]) -> dict[str, float]:
        """Computes the smallest time to encounter of each of some actors, s.

        Only times count at which the actor is ahead and in sight, and the ego on the move.
        """
        least: dict[str, float] = {}
        for frame, measures in zip(self.frames[self.released :], self.since_release, strict=True):
            if frame.ego_speed_mps < ON_THE_MOVE_MPS:
                continue
            ahead_m, encounter_s, seen = (measures.assessment.others[row].tolist() for row in (AHEAD, ENCOUNTER, SEEN))
            for name, ahead, after_s, visible in zip(frame.ids[1:], ahead_m, encounter_s, seen, strict=True):
                if ahead > 0.0 and visible and name in actors:
                    least[name] = min(after_s, least.get(name, math.inf))
        return least

    def append(self, frame: Frame, measures: Measures, action: Sequence[float] | None) -> None:
        """Records a frame and the action before it, None up to release."""
        self.frames.append(frame)
        self.measures.append(measures)
        if action is not None:
            self.actions.append(action)

    def series(self) -> dict[str, NDArray[np.generic]]:
        """Returns arrays by name: `T` frames, `n` actors, NaN after one leaves.

        `actions` is `T x a`, the action that led to the frame; NaN up to the release, which was at `released_s`. An
        actor of a story that was led away from it has the role of an adversary.
        """
        first = self.frames[0]
        column = {id_: i for i, id_ in enumerate(first.ids)}
        steps, n = len(self.frames), len(first.ids)
        result: dict[str, NDArray[np.generic]] = {
            "time_s": np.array([frame.time_s for frame in self.frames]),
            "released_s": np.array(self.frames[self.released].time_s),
            "ids": np.array(first.ids),
            "kind": first.kind,
            "body": first.body,
            "role": self._roles(column),
            "length_m": first.length_m,
            "width_m": first.width_m,
            "requirements": np.array(self.requirements),
            "robustness": np.array([m.robustness for m in self.measures]),
            "soft_min": np.array([m.soft_min for m in self.measures]),
            "least_ttc_s": np.array([m.signals["ttc_s"] for m in self.measures]),
            "signal": np.array([frame.signal for frame in self.frames], dtype=np.int8),
        }
        columns = [[column[id_] for id_ in frame.ids] for frame in self.frames]
        for name in PER_ACTOR:
            values = np.full((steps, n), np.nan)
            for t, frame in enumerate(self.frames):
                values[t, columns[t]] = getattr(frame, name)
            result[name] = values
        for name, row in PER_OTHER.items():
            values = np.full((steps, n), np.nan)
            for t, measures in enumerate(self.measures):
                values[t, columns[t][1:]] = measures.assessment.others[row]
            result[name] = values
        size = len(self.actions[0]) if self.actions else 0
        actions = np.full((steps, size), np.nan, dtype=np.float32)
        actions[self.released + 1 :] = self.actions
        result["actions"] = actions
        return result

    def _roles(self, column: Mapping[str, int]) -> NDArray[np.int8]:
        """Latest role of each actor, by its column."""
        roles = self.frames[0].role.copy()
        for frame in self.frames[1:]:
            if frame.role is not self.frames[0].role:
                roles[[column[id_] for id_ in frame.ids]] = frame.role
        return roles


def pack_series(series: dict[str, NDArray[np.generic]]) -> bytes:
    """Returns an .npz; the same arrays give the same bytes."""
    archive = io.BytesIO()
    np.savez_compressed(archive, allow_pickle=False, **series)
    return archive.getvalue()


def write_series(path: Path, content: bytes) -> SeriesFile:
    """Writes an .npz that is either complete or absent."""
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, content)
    return SeriesFile(path.name, hashlib.sha256(content).hexdigest())
