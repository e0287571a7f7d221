"""Joint policy's observation, in the ego's frame, scaled to about ±1.

Per adversary its motion relative to the ego and what C_soft remembers of it; then the ego itself, its signal and the
scene ξ; then the robustness of every requirement, places of static bodies and the time left. Robustness and that memory
are part of the state because STL and C_soft keep history: without them neither the shaped reward nor the cost would be
Markov.
"""

import numpy as np
from numpy.typing import NDArray

from risk_sac.env.observation_layout import (
    ACCEL_MPS2,
    GAP_M,
    LATERAL_MPS,
    LIMIT,
    MOTION_PER_ADVERSARY,
    PER_ADVERSARY,
    PER_EGO,
    PER_STATIC,
    SPEED_MPS,
    X_M,
    Y_M,
    observation_size,
)
from risk_sac.risk.conduct import MEMORY_SCALE
from risk_sac.risk.publish import AHEAD, ASIDE, CLOSING_X, CLOSING_Y, COS, GAP, SEEN, SIN, Assessment
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.scenario.families import Family
from risk_sac.world.jit import compiled
from risk_sac.world.types import ACCEL, LATERAL, SPEED, Floats, Frame


class Encoder:
    """Builds observations of a fixed size for one family."""

    def __init__(self, family: Family, scene_size: int, requirements: int) -> None:
        self._adversaries, self._statics = family.adversaries, family.statics
        self.size = observation_size(len(family.adversaries), scene_size, requirements, len(family.statics))
        self._ids: tuple[str, ...] = ()

    def encode(
        self,
        frame: Frame,
        assessment: Assessment,
        memory: Floats,
        robustness: Floats,
        unit_scene: Floats,
        time_left: float,
    ) -> NDArray[np.float32]:
        """Encodes a frame and what C_soft remembers.

        Args:
          frame: the latest.
          assessment: of that frame.
          memory: `ADVERSARY_MEMORY x adversaries`, see `risk_sac.risk.conduct`.
          robustness: of each requirement.
          unit_scene: the scene in the unit cube.
          time_left: share of the horizon.

        Returns:
          `size`, each entry in [-LIMIT, LIMIT]; an adversary that left the net, or an absent body, is all zeros.
        """
        if frame.ids is not self._ids:
            self._ids = frame.ids
            rows = [frame.ids.index(a) if a in frame.ids else 0 for a in (*self._adversaries, *self._statics)]
            self._rows = np.array(rows, dtype=np.intp)  # a scenario may have no adversary
        return _encoded(
            self.size,
            self._rows,
            len(self._adversaries),
            assessment.others,
            frame.state,
            memory,
            frame.stop_line_m,
            int(frame.signal),
            unit_scene,
            robustness,
            time_left,
        )


@compiled
def _encoded(
    size: int,
    rows: NDArray[np.int64],
    adversaries: int,
    others: Floats,
    state: Floats,
    memory: Floats,
    stop_line_m: float,
    signal: int,
    unit_scene: Floats,
    robustness: Floats,
    time_left: float,
) -> NDArray[np.float32]:
    result = np.zeros(size)
    for slot in range(adversaries):
        row = rows[slot]
        if row == 0:  # left the net; 0 is the ego itself
            continue
        i, at = row - 1, slot * PER_ADVERSARY
        result[at] = others[AHEAD, i] / X_M
        result[at + 1] = others[ASIDE, i] / Y_M
        result[at + 2] = others[CLOSING_X, i] / SPEED_MPS
        result[at + 3] = others[CLOSING_Y, i] / LATERAL_MPS
        result[at + 4] = others[COS, i]
        result[at + 5] = others[SIN, i]
        result[at + 6] = state[SPEED, row] / SPEED_MPS
        result[at + 7] = state[ACCEL, row] / ACCEL_MPS2
        result[at + 8] = others[GAP, i] / GAP_M
        result[at + 9] = others[SEEN, i]
        for k in range(len(MEMORY_SCALE)):
            result[at + MOTION_PER_ADVERSARY + k] = memory[k, slot] / MEMORY_SCALE[k]
    at = adversaries * PER_ADVERSARY
    result[at] = state[SPEED, 0] / SPEED_MPS
    result[at + 1] = state[ACCEL, 0] / ACCEL_MPS2
    result[at + 2] = state[LATERAL, 0] / LATERAL_MPS
    result[at + 3] = stop_line_m / X_M
    result[at + 4 + signal] = 1.0
    at += PER_EGO
    for value in unit_scene:
        result[at] = value
        at += 1
    for value in robustness:
        result[at] = value / ROBUSTNESS_CLIP
        at += 1
    for row in rows[adversaries:]:
        if row > 0:
            result[at], result[at + 1] = others[AHEAD, row - 1] / X_M, others[ASIDE, row - 1] / Y_M
        at += PER_STATIC
    result[at] = time_left
    return np.minimum(np.maximum(result, -LIMIT), LIMIT).astype(np.float32)
