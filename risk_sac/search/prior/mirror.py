"""Mirrors episodes of a family whose scenes are alike on both sides of the ego."""

from dataclasses import replace

import numpy as np

from risk_sac.env.observation_layout import LATERAL_ADVERSARY, LATERAL_EGO, PER_ADVERSARY, PER_EGO, PER_STATIC
from risk_sac.search.agents.transition import Transition
from risk_sac.search.prior.coordinates import other_side, two_sided
from risk_sac.search.prior.policy import PolicyLayout
from risk_sac.world.types import Vector


class Mirror:
    """Exchanges what is on the left and on the right of the ego."""

    def __init__(self, layout: PolicyLayout) -> None:
        """Finds the counterpart of each entry of an observation and of an action."""
        adversaries = [layout.adversaries.index(other_side(name)) for name in layout.adversaries]
        names = [name for name, *_ in layout.scene]
        scene = [names.index(other_side(name)) for name in names]
        count, ego = len(adversaries), len(adversaries) * PER_ADVERSARY
        self._seen = np.arange(layout.observation_size)
        self._seen[:ego] = (PER_ADVERSARY * np.array(adversaries)[:, None] + np.arange(PER_ADVERSARY)).ravel()
        self._seen[ego + PER_EGO : ego + PER_EGO + len(scene)] = ego + PER_EGO + np.array(scene)
        self._seen_sign = np.ones(layout.observation_size, np.float32)
        self._seen_sign[(PER_ADVERSARY * np.arange(count)[:, None] + LATERAL_ADVERSARY).ravel()] = -1.0
        self._seen_sign[ego + LATERAL_EGO] = -1.0
        self._seen_sign[-2 : -2 - PER_STATIC * layout.statics : -PER_STATIC] = -1.0
        self._acted = (2 * np.array(adversaries)[:, None] + np.arange(2)).ravel()
        self._acted_sign = np.tile(np.array([1.0, -1.0], np.float32), count)  # acceleration, lateral velocity

    @classmethod
    def of(cls, layout: PolicyLayout) -> "Mirror | None":
        """Returns the mirror of a family with a neighbour on either side; None for the others."""
        return cls(layout) if two_sided(layout.adversaries, [name for name, *_ in layout.scene]) else None

    def observation(self, seen: Vector) -> Vector:
        """Returns what is observed in the mirrored scene."""
        return seen[self._seen] * self._seen_sign

    def action(self, acted: Vector) -> Vector:
        """Returns the mirrored action."""
        return acted[self._acted] * self._acted_sign

    def transition(self, step: Transition) -> Transition:
        """Returns the mirrored transition."""
        return replace(
            step,
            observation=self.observation(step.observation),
            action=self.action(step.action),
            next_observation=self.observation(step.next_observation),
        )
