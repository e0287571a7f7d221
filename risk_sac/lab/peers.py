"""Public optimisers as samplers, with their authors' defaults: rows to compare a search with.

`cma`, `optuna` and `pymoo` are optional, see the extra `peers`.
"""

import math
from collections import deque
from typing import Any

import numpy as np

from risk_sac.world.types import Floats

FAILED = 0.0  # a score below it is a failure's


class Uniform:
    """Draws scenes and scripts uniformly: the control of the others."""

    def __init__(self, dimension: int, seed: int) -> None:
        self._dimension, self._random = dimension, np.random.default_rng(seed)

    def ask(self) -> Floats:
        """Returns the next point."""
        return self._random.random(self._dimension)

    def waits(self) -> bool:
        """Whether it needs a score before the next point."""
        return False

    def tell(self, point: Floats, score: float) -> None:
        """Learns nothing."""


class CrossEntropy:
    """VerifAI's cross-entropy sampler: a histogram of each coordinate moves towards what failed.

    Source: Dreossi et al. 2019, "VerifAI", CAV; the buckets and the rate are VerifAI's defaults.
    """

    BUCKETS, KEPT = 5, 0.9

    def __init__(self, dimension: int, seed: int) -> None:
        self._random = np.random.default_rng(seed)
        self._shares = np.full((dimension, self.BUCKETS), 1.0 / self.BUCKETS)

    def ask(self) -> Floats:
        """Returns the next point."""
        buckets = np.array([self._random.choice(self.BUCKETS, p=shares) for shares in self._shares])
        return np.asarray((buckets + self._random.random(len(buckets))) / self.BUCKETS)

    def waits(self) -> bool:
        """Whether it needs a score before the next point."""
        return False

    def tell(self, point: Floats, score: float) -> None:
        """Moves the histograms towards a failure."""
        if score >= FAILED:
            return
        buckets = np.minimum((point * self.BUCKETS).astype(int), self.BUCKETS - 1)
        self._shares *= self.KEPT
        self._shares[np.arange(len(point)), buckets] += 1.0 - self.KEPT


class Tpe:
    """Optuna's tree-structured Parzen estimator over all coordinates together.

    Source: Bergstra et al. 2011, "Algorithms for Hyper-Parameter Optimization", NIPS.
    """

    def __init__(self, dimension: int, seed: int) -> None:
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        sampler = optuna.samplers.TPESampler(seed=_seed(seed), multivariate=True)
        self._study = optuna.create_study(sampler=sampler)
        self._names = [f"x{number}" for number in range(dimension)]
        self._trials: deque[Any] = deque()

    def ask(self) -> Floats:
        """Returns the next point."""
        self._trials.append(self._study.ask())
        return np.array([self._trials[-1].suggest_float(name, 0.0, 1.0) for name in self._names])

    def waits(self) -> bool:
        """Whether it needs a score before the next point."""
        return False

    def tell(self, point: Floats, score: float) -> None:
        """Ends the trial."""
        self._study.tell(self._trials.popleft(), score)


class CmaEs:
    """CMA-ES; it starts again from a random point after a generation with a failure, and where it stops.

    Source: Hansen 2016, "The CMA Evolution Strategy: A Tutorial".
    """

    DEVIATION = 0.3  # of the first generation

    def __init__(self, dimension: int, seed: int) -> None:
        self._dimension, self._random = dimension, np.random.default_rng(seed)
        self._strategy: Any = None
        self._queue: deque[Floats] = deque()
        self._out: deque[Floats] = deque()
        self._told: list[tuple[Floats, float]] = []

    def ask(self) -> Floats:
        """Returns the next point."""
        if not self._queue:
            self._next_generation()
        self._out.append(self._queue.popleft())
        return self._out[-1]

    def waits(self) -> bool:
        """Whether it needs a score before the next point."""
        return bool(self._out) and not self._queue

    def tell(self, point: Floats, score: float) -> None:
        """Learns from a whole generation."""
        self._told.append((self._out.popleft(), score))

    def _normal(self, *shape: int) -> Floats:
        return self._random.standard_normal(shape)

    def _next_generation(self) -> None:
        import cma

        if self._told:
            points, scores = zip(*self._told, strict=True)
            self._strategy.tell(list(points), list(scores))
            if min(scores) < FAILED or self._strategy.stop():
                self._strategy = None
        if self._strategy is None:
            # Its default is numpy's global generator.
            options = {"bounds": [0, 1], "verbose": -9, "seed": math.nan, "randn": self._normal}
            first = self._random.random(self._dimension)
            self._strategy = cma.CMAEvolutionStrategy(first, self.DEVIATION, options)
        self._queue, self._told = deque(map(np.asarray, self._strategy.ask())), []


class Nsga2:
    """NSGA-II, as OpenSBT has it; minimises the score, and maximises the distance to failures that were found.

    Source: Deb et al. 2002, IEEE Trans. Evol. Comput. 6(2); pymoo's operators.
    """

    POPULATION = 30  # choice
    REMEMBERED = 200  # failures that a point is compared with

    def __init__(self, dimension: int, seed: int) -> None:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination

        self._problem = Problem(n_var=dimension, n_obj=2, xl=0.0, xu=1.0)
        self._algorithm = NSGA2(pop_size=self.POPULATION)
        self._algorithm.setup(self._problem, termination=NoTermination(), seed=_seed(seed), verbose=False)
        self._population: Any = None
        self._queue: deque[Floats] = deque()
        self._out = 0
        self._objectives: list[tuple[float, float]] = []
        self._failures: deque[Floats] = deque(maxlen=self.REMEMBERED)

    def ask(self) -> Floats:
        """Returns the next point."""
        if not self._queue:
            self._next_generation()
        self._out += 1
        return np.clip(self._queue.popleft(), 0.0, 1.0)

    def waits(self) -> bool:
        """Whether it needs a score before the next point."""
        return self._out > 0 and not self._queue

    def tell(self, point: Floats, score: float) -> None:
        """Learns from a whole generation."""
        self._out -= 1
        distance = min((float(np.linalg.norm(point - other)) for other in self._failures), default=1.0)
        self._objectives.append((score, -distance))
        if score < FAILED:
            self._failures.append(point)

    def _next_generation(self) -> None:
        from pymoo.core.evaluator import Evaluator
        from pymoo.problems.static import StaticProblem

        if self._population is not None:
            known = StaticProblem(self._problem, F=np.array(self._objectives))
            Evaluator().eval(known, self._population)
            self._algorithm.tell(infills=self._population)
        self._population = self._algorithm.ask()
        self._queue, self._objectives = deque(self._population.get("X")), []


def _seed(seed: int) -> int:
    """Returns a seed that fits into 31 bits."""
    return int(np.random.SeedSequence(seed).generate_state(1)[0] >> 1)
