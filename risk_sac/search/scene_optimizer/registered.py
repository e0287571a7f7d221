"""Registered samplers that propose scenes and scripts, and minimise a score."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from risk_sac.config import SceneOptimizerConfig
from risk_sac.config.methods import GROUP, sampler_of
from risk_sac.errors import ConfigError
from risk_sac.records import Collision, DrivenBy
from risk_sac.search.encounter import Encounter
from risk_sac.search.scene_optimizer.base import SceneOptimizer, State
from risk_sac.world.types import Floats

REFUSED, TOUCHED = 2.0, 0.5  # scores of a scene that is refused, and of a contact that does not count
FAILED, CANDIDATE = -1.0, -1.0  # scores of a failure, and beside it of a headline candidate
FASTEST_MPS, FAST_SCORE = 20.0, -0.5  # closing speed from which on a contact gains no more, and its score
MARGIN, NEAR_S = 5.0, 10.0  # least robustness and time to encounter from which on a pass is no better
PASSED = 0.05  # lowest score of a pass


class Sampler(Protocol):
    """Proposes points of the unit cube and learns from their scores.

    The same calls in the same order have to lead to the same points: an interrupted run repeats them. In rounds, a
    sampler with a method `waits()` is asked again, until that is true, before it is told; answers come in the order of
    the points.
    """

    def ask(self) -> Floats:
        """Returns the next point, `d`, in [0, 1]."""

    def tell(self, point: Floats, score: float) -> None:
        """Learns a point's score; smaller is better, below 0 the ego failed."""


SamplerClass = Callable[[int, int], Sampler]
"""Makes a sampler from the number of dimensions and a seed."""


def score_of(encounter: Encounter) -> float:
    """Scores an episode for an optimiser with one objective, to be minimised.

    A failure has -1, less 1 for a headline candidate, less up to 0.5 by the closing speed. A contact that does not
    count has 0.5. Else 0.05, plus up to 0.5 each for the least margin of a requirement and the time to encounter.

    Returns:
      In [-2.5, 1.05].
    """
    worst = encounter.worst
    if worst is not None:
        speed_mps = worst.relative_speed_mps if isinstance(worst, Collision) else 0.0
        fast = FAST_SCORE * min(speed_mps / FASTEST_MPS, 1.0)
        return FAILED + CANDIDATE * worst.headline_candidate + fast
    if encounter.collision is not None:
        return TOUCHED
    margin = min(encounter.margins.values(), default=MARGIN)
    near_s = min(encounter.encounters_s.values(), default=NEAR_S)
    return PASSED + 0.5 * min(max(margin / MARGIN, 0.0), 1.0) + 0.5 * min(max(near_s / NEAR_S, 0.0), 1.0)


class RegisteredSampler(SceneOptimizer):
    """Asks a registered sampler for scenes and scripts.

    A scene that breaks a constraint is refused like any other, so that the sampler learns where scenes are.
    """

    kind = "registered"
    tries = 0
    driven_by = DrivenBy.SCRIPT

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int, method: str) -> None:
        """Makes the sampler that a method names.

        Raises:
          ConfigError: there is none of that name, or it cannot be made.
        """
        super().__init__(dimension, config, seed)
        self._method = method
        self._calls: list[tuple[list[float], float] | None] = []  # None: `ask`
        self._sampler = self._made()

    def waits(self, out: int) -> bool:
        """Whether it waits for results that are out: by default for any."""
        if out == 0:
            return False
        waits = getattr(self._sampler, "waits", None)
        return waits is None or bool(self._call("waits", waits))

    def ask(self) -> Floats:
        """See `SceneOptimizer.ask`.

        Raises:
          ConfigError: the sampler raised, or its answer is no point of the unit cube.
        """
        point = np.array(self._call("ask", self._sampler.ask), dtype=np.float64)
        self._calls.append(None)
        if point.shape != (self._dimension,) or not ((point >= 0.0) & (point <= 1.0)).all():
            got = f"{point.tolist()} from {self._method!r}"
            raise ConfigError(f"{GROUP}: ask", got, f"{self._dimension} coordinates in [0, 1]")
        return point

    def _learn(self, point: Floats, mean_return: float | None, score: float | None, encounter: Encounter) -> None:
        self._tell(point, REFUSED if mean_return is None else score_of(encounter))

    def _tell(self, point: Floats, score: float) -> None:
        self._calls.append((point.tolist(), score))
        self._call("tell", lambda: self._sampler.tell(point, score))

    def state(self) -> State:
        """Returns all calls, since a sampler need not know its own state."""
        return {**super().state(), "calls": list(self._calls)}

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`; repeats the calls."""
        super().load(state)
        self._calls, self._sampler = [], self._made()
        for call in state["calls"]:
            if call is None:
                self.ask()
            else:
                self._tell(np.array(call[0]), call[1])

    def _made(self) -> Sampler:
        point = sampler_of(self._method)
        made: Sampler = self._call("cannot be made", lambda: point.load()(self._dimension, self._seed))
        return made

    def _call(self, what: str, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except Exception as error:  # foreign code may raise anything
            got = f"{type(error).__name__}: {error}, from {self._method!r}"
            raise ConfigError(f"{GROUP}: {what}", got, "no error") from error
