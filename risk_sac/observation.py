"""What the joint policy sees, in the ego's frame and scaled to about [-1, 1].

Per adversary its motion relative to the ego, then the ego itself, its signal, the scene ξ, the
robustness of every requirement and the time left. Robustness is part of the state because STL keeps
history: without it the shaped reward would not be Markov.
"""

import numpy as np
from numpy.typing import NDArray

from risk_sac.geometry import RelativeView
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.scenario.families import Family
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
        self._rows: list[int] = []

    def encode(
        self,
        frame: Frame,
        view: RelativeView,
        gap_m: Floats,
        visible: Bools,
        robustness: Floats,
        unit_scene: Floats,
        time_left: float,
    ) -> NDArray[np.float32]:
        """The observation, `size`, each entry in [-LIMIT, LIMIT]; an adversary that left the net is all zeros."""
        k = len(self._adversaries)
        result = np.zeros(self.size)
        if frame.ids is not self._ids:
            self._ids = frame.ids
            present = [(slot, frame.ids.index(a)) for slot, a in enumerate(self._adversaries) if a in frame.ids]
            self._slots = np.array([slot for slot, _ in present], dtype=np.intp)
            self._others = np.array([row - 1 for _, row in present], dtype=np.intp)
        others = self._others
        actors = result[: PER_ADVERSARY * k].reshape(PER_ADVERSARY, k)
        slots = self._slots
        actors[0, slots] = view.x[others] / X_M
        actors[1, slots] = view.y[others] / Y_M
        actors[2, slots] = view.vx[others] / SPEED_MPS
        actors[3, slots] = view.vy[others] / LATERAL_MPS
        actors[4, slots] = view.cos[others]
        actors[5, slots] = view.sin[others]
        actors[6, slots] = frame.speed_mps[1:][others] / SPEED_MPS
        actors[7, slots] = frame.accel_mps2[1:][others] / ACCEL_MPS2
        actors[8, slots] = gap_m[others] / GAP_M
        actors[9, slots] = visible[others]
        rest = PER_ADVERSARY * k
        result[rest : rest + PER_EGO - 4] = (
            frame.speed_mps[0] / SPEED_MPS,
            frame.accel_mps2[0] / ACCEL_MPS2,
            frame.lateral_mps[0] / LATERAL_MPS,
            min(frame.stop_line_m / X_M, LIMIT),
        )
        result[rest + PER_EGO - 4 + frame.signal] = 1.0
        rest += PER_EGO
        result[rest : rest + len(unit_scene)] = unit_scene
        rest += len(unit_scene)
        result[rest : rest + len(robustness)] = robustness / ROBUSTNESS_CLIP
        result[-1] = time_left
        return np.clip(result, -LIMIT, LIMIT).astype(np.float32)
