"""Adversaries that follow scripts: what a search over scenes and scripts drives them with."""

from collections.abc import Sequence

import numpy as np

from risk_sac.agents.controls import Control
from risk_sac.scenario.family import Family
from risk_sac.scripts.motions import SIZE, Genes, Seen, act, adversaries_seen, cue, is_over
from risk_sac.types import STEP_S, Floats, Vector

PASSIVE = 0.4  # an adversary whose gene `active` is smaller does nothing, unless it is the largest of all
BEHIND_M, BEHIND_STEPS = 6.0, 8  # so far and so long behind the ego, it no longer strikes
STANDING_MPS, STANDING_STEPS = 0.5, 30  # an ego that stands for so long waits for a signal, or for a queue


class ScriptFollower(Control):
    """Drives each adversary by genes of its own; λ and α are 0.

    An episode begins with the genes.

    Attributes:
      can_stop_early: whether the rest of the episode is not worth playing: all adversaries that act have fallen
        behind, or have finished their scripts a while ago, or the ego stands for long. Choice: such an episode is
        truncated; it counts as safe, with its steps.
    """

    def __init__(self, family: Family) -> None:
        """Follows nothing yet; see `begin`."""
        self._pedestrian = [False] * len(family.vehicles) + [True] * len(family.pedestrians)
        self.genes = SIZE * len(self._pedestrian)  # number of genes that an episode takes
        self.begin(np.zeros(self.genes))

    def begin(self, genes: Floats) -> None:
        """Begins an episode with these genes, in [0, 1]; `SIZE` for each adversary."""
        rows: list[list[float]] = genes.reshape(-1, SIZE).tolist()
        threshold = min(PASSIVE, max(row[0] for row in rows))
        self._scripts = [Genes(*row) if row[0] >= threshold else None for row in rows]
        self._cued: list[int | None] = [None] * len(rows)
        self._step, self._behind, self._standing = 0, 0, 0
        self.can_stop_early = False

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Acts on what `risk_sac.observation` says of each adversary; nothing is random."""
        seen = adversaries_seen(observation, len(self._pedestrian), self._step)
        actions = np.zeros((len(seen), 2), dtype=np.float32)
        since_cue_s = [self._since_cue_s(i, one) for i, one in enumerate(seen)]
        for i, one in enumerate(seen):
            script = self._scripts[i]
            if script is not None and one is not None:
                actions[i] = act(script, one, since_cue_s[i], self._pedestrian[i])
        self._foresee(seen, since_cue_s)
        self._step += 1
        return actions.ravel()

    def _since_cue_s(self, i: int, seen: Seen | None) -> float:
        """Returns the time since an adversary's cue, s; negative before."""
        script = self._scripts[i]
        if self._cued[i] is None and script and seen and cue(script, seen, self._pedestrian[i]):
            self._cued[i] = self._step
        cued = self._cued[i]
        return -STEP_S if cued is None else (self._step - cued) * STEP_S

    def _foresee(self, seen: Sequence[Seen | None], since_cue_s: Sequence[float]) -> None:
        acting = [
            (script, one, since_s)
            for script, one, since_s in zip(self._scripts, seen, since_cue_s, strict=True)
            if script is not None and one is not None
        ]
        behind = all(one.x_m < -BEHIND_M for _, one, _ in acting)
        self._behind = self._behind + 1 if behind else 0
        standing = all(one.ego_mps < STANDING_MPS for _, one, _ in acting)
        self._standing = self._standing + 1 if standing else 0
        over = all(is_over(script, since_s) for script, _, since_s in acting)
        self.can_stop_early = over or self._behind >= BEHIND_STEPS or self._standing >= STANDING_STEPS
