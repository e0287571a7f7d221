"""Frames to test with: what a test does not speak of is at rest, straight ahead and of a car's size."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from risk_sac.sim.ego import MOTION, Belief
from risk_sac.types import Floats, Frame, Kind, Role, Row, Signal

ROWS = {name: row.index for name, row in vars(Frame).items() if isinstance(row, Row)}
CAR_M, WALKER_M = (4.6, 1.85), (0.5, 0.5)


def frame_of(
    kind: Sequence[Kind] | None = None,
    *,
    time_s: float = 0.0,
    ids: tuple[str, ...] | None = None,
    signal: Signal = Signal.NONE,
    stop_line_m: float = math.inf,
    link: Sequence[int] | None = None,
    **rows: float | Sequence[float] | Floats,
) -> Frame:
    """A frame of `n` actors, the ego first, from the rows of its state.

    Args:
      kind: `n`; vehicles if not given.
      time_s: when.
      ids: `n`; actor_0, actor_1 … if not given.
      signal: ahead of the ego.
      stop_line_m: distance to its line.
      link: `n`, letters of the signals ahead.
      rows: `x_m` and whatever else is known. Speed is that of the velocity, and the velocity that of speed and heading.
    """
    n = len(np.atleast_1d(rows["x_m"]))
    kinds = np.array(kind if kind is not None else [Kind.VEHICLE] * n, dtype=np.int8)
    size = np.where(kinds == Kind.VEHICLE, np.reshape(CAR_M, (2, 1)), np.reshape(WALKER_M, (2, 1)))
    values = {name: np.zeros(n) for name in ROWS} | {"length_m": size[0], "width_m": size[1]}
    values |= {name: np.broadcast_to(np.asarray(row, dtype=np.float64), n) for name, row in rows.items()}
    if "speed_mps" not in rows:
        values["speed_mps"] = np.hypot(values["vx_mps"], values["vy_mps"])
    elif "vx_mps" not in rows and "vy_mps" not in rows:
        values["vx_mps"] = values["speed_mps"] * np.cos(values["heading_rad"])
        values["vy_mps"] = values["speed_mps"] * np.sin(values["heading_rad"])
    return Frame(
        time_s=time_s,
        ids=ids or tuple(f"actor_{i}" for i in range(n)),
        kind=kinds,
        role=np.array([Role.EGO] + [Role.ADVERSARY] * (n - 1), dtype=np.int8),
        state=np.array([values[name] for name in ROWS]),
        signal=signal,
        stop_line_m=stop_line_m,
        link=np.zeros(n, dtype=np.uint8) if link is None else np.array(link, dtype=np.uint8),
    )


def moved(frame: Frame, **rows: float | Sequence[float] | Floats) -> Frame:
    """The frame with other values in the rows that are given."""
    state = frame.state.copy()
    for name, row in rows.items():
        state[ROWS[name]] = row
    return replace(frame, state=state)


def belief_of(
    frame: Frame, hidden: Collection[str] = (), expected: Mapping[str, Sequence[float]] | None = None
) -> Belief:
    """That the ego knows nothing of some actors, and expects others at x, y, heading with a velocity."""
    where = np.full((len(MOTION), len(frame.ids)), np.nan)
    for id_, motion in (expected or {}).items():
        where[:, frame.ids.index(id_)] = motion
    return Belief(np.array([id_ not in hidden for id_ in frame.ids]), where)


class Told:
    """Senses of an ego that is told what to make of the k-th frame of an episode."""

    def __init__(self, tell: Callable[[Frame, int], Belief]) -> None:
        self.tell = tell
        self._frames = 0

    def reset(self) -> None:
        self._frames = 0

    def look(self, frame: Frame) -> Belief:
        self._frames += 1
        return self.tell(frame, self._frames - 1)
