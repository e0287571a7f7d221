"""Asks for scenes in stages, fitted to earlier failures, to estimate rates.

See `risk_sac.rates`.
"""

import numpy as np

from risk_sac.config import RateStart, SceneOptimizerConfig
from risk_sac.rates.proposal import Draws, draws_of
from risk_sac.rates.record import stages_of
from risk_sac.scenario.declared import SceneLaw
from risk_sac.search.encounter import NO_ENCOUNTER, Encounter
from risk_sac.search.scene_optimizer.base import SceneOptimizer, State
from risk_sac.world.types import Floats


class RateSampler(SceneOptimizer):
    """Sampler of the declared distribution mixed with scenes near earlier failures.

    No scene has a score. It draws no scene that the state of an earlier process did not know of.
    """

    kind = "rate"
    tries = 0  # a point that breaks a constraint is refused and counted, so that the weights of the others hold

    def __init__(
        self,
        dimension: int,
        config: SceneOptimizerConfig,
        seed: int,
        declared: SceneLaw,
        draws: int,
        start: RateStart | None = None,
    ) -> None:
        """Prepares the stages.

        Args:
          dimension: number of axes.
          config: of scene optimizers.
          seed: of all draws.
          declared: distribution of the scenes.
          draws: number of scenes of the whole run.
          start: scenes that failed before it.
        """
        super().__init__(dimension, config, seed)
        self._declared = declared
        self._stages = stages_of(declared, draws, seed, start)
        self._points: list[Floats] = []
        self._margins: list[dict[str, float]] = []
        self._failed: list[bool] = []

    def waits(self, out: int) -> bool:
        """See `SceneOptimizer.waits`: a stage's proposal is fitted to all draws before it.

        So each draw's weight has the density that it was drawn from, and the same scenes are drawn in rounds of any
        size.
        """
        return len(self._points) < self._stages.start(len(self._points) + out)

    def ask(self) -> Floats:
        """See `SceneOptimizer.ask`."""
        number, telling = len(self._points) + len(self.out), self._declared.telling
        normal = np.random.default_rng((self._seed, number, 1)).standard_normal(self._dimension)
        normal[telling] = self._stages.draw(number, self.draws)
        return self._declared.point(normal)

    def tell(self, u: Floats, mean_return: float | None, encounter: Encounter = NO_ENCOUNTER) -> None:
        """See `SceneOptimizer.tell`; always None."""
        super().tell(u, mean_return, encounter)
        self._points.append(self._declared.normal(u)[self._declared.telling])
        self._margins.append({} if mean_return is None else dict(encounter.margins))
        self._failed.append(bool(encounter.valid_violations))

    def draws(self) -> Draws:
        """Outcomes of all draws so far."""
        return draws_of(self._points, self._margins, self._failed)

    def state(self) -> State:
        """See `SceneOptimizer.state`."""
        points = [point.tolist() for point in self._points]
        return {**super().state(), "points": points, "margins": list(self._margins), "failed": list(self._failed)}

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        super().load(state)
        self._points = [np.array(point) for point in state["points"]]
        self._margins, self._failed = list(state["margins"]), list(state["failed"])
