"""How far the next scene is looked for: anywhere, or near one of the best; whichever of late has come to more.

In 18 dimensions a smooth model does not tell the few scenes around a failure from noise, so that what it proposes is
spread over everything. Who looks near what has failed already finds more, where the model cannot, and less, where it
can.

Source: the thought is that of trust regions, Eriksson et al., "Scalable global optimization via local Bayesian
optimization", 2019; which of both it is to be, is ours.
"""

from typing import Any

KEPT = 0.95  # of what an earlier scene counts, after another one that was found by the same reach
EXPECTED, EXPECTED_SCENES = 0.05, 5.0  # worth of a scene, of a reach that was not tried; as many scenes is it believed
LEAST = 0.05  # chance of either


class Reach:
    """A bandit with two arms, 0: anywhere, 1: near. The chances go by the squares of what each comes to."""

    def __init__(self) -> None:
        """Begins without experience: either is as likely."""
        self._worth, self._scenes = [0.0, 0.0], [0.0, 0.0]

    @property
    def near(self) -> float:
        """The chance that the next scene is to be looked for near one of the best."""
        anywhere, near = (
            ((worth + EXPECTED * EXPECTED_SCENES) / (scenes + EXPECTED_SCENES)) ** 2
            for worth, scenes in zip(self._worth, self._scenes, strict=True)
        )
        return min(max(near / (anywhere + near), LEAST), 1.0 - LEAST)

    def tell(self, score: float | None, *, near: bool) -> None:
        """Takes note of a scene.

        Args:
          score: f_e of (11), 0 for the best; None if it was rejected.
          near: how it was found.
        """
        worth = 0.0 if score is None else max(0.0, 1.0 - score)
        self._worth[near] = KEPT * self._worth[near] + worth
        self._scenes[near] = KEPT * self._scenes[near] + 1.0

    def state(self) -> dict[str, Any]:
        """Plain values, to go on from."""
        return {"worth": list(self._worth), "scenes": list(self._scenes)}

    def load(self, state: dict[str, Any]) -> None:
        """Goes on from `state()`."""
        self._worth, self._scenes = list(state["worth"]), list(state["scenes"])
