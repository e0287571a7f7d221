"""What the joint policy sees, in the ego's frame and scaled to about [-1, 1].

Per adversary its motion relative to the ego, then the ego itself, its signal, the scene ξ, the
robustness of every requirement and the time left. Robustness is part of the state because STL keeps
history: without it the shaped reward would not be Markov.
"""

import numpy as np
from numpy.typing import NDArray

from risk_sac.geometry import RelativeView
from risk_sac.jit import compiled
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.scenario.family import Family
from risk_sac.types import Bools, Floats, Frame

PER_ADVERSARY = 10
PER_EGO = 8
LIMIT = 5.0  # of every entry

X_M, Y_M, SPEED_MPS, LATERAL_MPS, ACCEL_MPS2, GAP_M = 40.0, 8.0, 15.0, 4.0, 8.0, 20.0  # scales


class Encoder:
    """Builds observations of a fixed size for one family."""

    def __init__(self, family: Family, scene_size: int, requirements: int) -> None:
        self._adversaries = family.adversaries
        self.size = PER_ADVERSARY * len(family.adversaries) + PER_EGO + scene_size + requirements + 1
        self._ids: tuple[str, ...] = ()

    def encode(
        self,
        frame: Frame,
        view: RelativeView,
        visible: Bools,
        robustness: Floats,
        unit_scene: Floats,
        time_left: float,
    ) -> NDArray[np.float32]:
        """The observation, `size`, each entry in [-LIMIT, LIMIT]; an adversary that left the net is all zeros."""
        if frame.ids is not self._ids:
            self._ids = frame.ids
            self._rows = np.array([frame.ids.index(a) if a in frame.ids else 0 for a in self._adversaries])
        result = np.zeros(self.size)
        _fill(
            result,
            self._rows,
            view,
            visible,
            frame.speed_mps,
            frame.accel_mps2,
            frame.lateral_mps[0],
            frame.stop_line_m,
            int(frame.signal),
            unit_scene,
            robustness,
            time_left,
        )
        return result.astype(np.float32)


@compiled
def _fill(
    result: Floats,
    rows: NDArray[np.int64],
    view: RelativeView,
    visible: Bools,
    speed_mps: Floats,
    accel_mps2: Floats,
    ego_lateral_mps: float,
    stop_line_m: float,
    signal: int,
    unit_scene: Floats,
    robustness: Floats,
    time_left: float,
) -> None:
    for slot in range(len(rows)):
        row = rows[slot]
        if row == 0:  # left the net; 0 is the ego itself
            continue
        i, at = row - 1, slot * PER_ADVERSARY
        result[at] = view.x[i] / X_M
        result[at + 1] = view.y[i] / Y_M
        result[at + 2] = view.vx[i] / SPEED_MPS
        result[at + 3] = view.vy[i] / LATERAL_MPS
        result[at + 4] = view.cos[i]
        result[at + 5] = view.sin[i]
        result[at + 6] = speed_mps[row] / SPEED_MPS
        result[at + 7] = accel_mps2[row] / ACCEL_MPS2
        result[at + 8] = view.gap[i] / GAP_M
        result[at + 9] = visible[i]
    at = len(rows) * PER_ADVERSARY
    result[at] = speed_mps[0] / SPEED_MPS
    result[at + 1] = accel_mps2[0] / ACCEL_MPS2
    result[at + 2] = ego_lateral_mps / LATERAL_MPS
    result[at + 3] = stop_line_m / X_M
    result[at + 4 + signal] = 1.0
    at += PER_EGO
    for values in (unit_scene, robustness / ROBUSTNESS_CLIP):
        for value in values:
            result[at] = value
            at += 1
    result[at] = time_left
    for k in range(len(result)):
        result[k] = min(max(result[k], -LIMIT), LIMIT)
