"""What a script goes by: an adversary as the observation has it, back in metres and seconds."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.observation_layout import PER_ADVERSARY, SPEED_MPS, X_M, Y_M
from risk_sac.types import STEP_S


class Seen(NamedTuple):
    """One adversary in the ego's frame, and the ego."""

    time_s: float  # since the release
    x_m: float  # between the centres
    y_m: float
    cos: float  # of the heading relative to the ego's
    sin: float
    speed_mps: float
    ego_mps: float


class Act(NamedTuple):
    """An action in [-1, 1]: acceleration and, of a vehicle, lateral speed, or, of a pedestrian, heading rate."""

    drive: float
    steer: float


def adversaries_seen(observation: NDArray[np.float32], adversaries: int, step: int) -> list[Seen | None]:
    """Each adversary, in the family's order; None for one that has left the net.

    Args:
      observation: see `risk_sac.observation`.
      adversaries: how many.
      step: of the episode, from 0.
    """
    rows: list[list[float]] = observation[: adversaries * PER_ADVERSARY].reshape(-1, PER_ADVERSARY).tolist()
    ego_mps = float(observation[adversaries * PER_ADVERSARY]) * SPEED_MPS
    return [_seen(row, step * STEP_S, ego_mps) if any(row) else None for row in rows]


def _seen(row: list[float], time_s: float, ego_mps: float) -> Seen:
    x, y, _, _, cos, sin, speed, *_ = row
    return Seen(time_s, x * X_M, y * Y_M, cos, sin, speed * SPEED_MPS, ego_mps)
