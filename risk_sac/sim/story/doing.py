"""Interface between the engine and a running action."""

from typing import Protocol

from risk_sac.sim.story.cast import Mover
from risk_sac.sim.story.stage import Stage

ALONG, ACROSS = frozenset({"along"}), frozenset({"across"})
NEITHER: frozenset[str] = frozenset()


class Doing(Protocol):
    """An action of one actor while it runs.

    Attributes:
      controls: "along", "across" or both; an action ends another one of the same actor that controls the same.
    """

    controls: frozenset[str]

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """Starts now; returns whether it is over already."""

    def step(self, mover: Mover, stage: Stage) -> bool:
        """Says what the actor does in the next step; returns whether the action is over then."""
