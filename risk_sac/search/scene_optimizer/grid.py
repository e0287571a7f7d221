"""Plays a scenario's grid: all points in order, or a stratified sample."""

import itertools

import numpy as np

from risk_sac.config import SceneOptimizerConfig
from risk_sac.errors import CheckpointError
from risk_sac.scenario.space import Grid, SceneSpace
from risk_sac.search.scene_optimizer.base import SceneOptimizer, State, sobol_points
from risk_sac.world.types import Floats, Scene

BATCH = 1024  # Sobol points drawn at a time


class GridSampler(SceneOptimizer):
    """Sampler of a grid's scenes, each once, then from the beginning.

    Attributes:
      points: number of scenes, at most the budget's.
    """

    kind = "grid"
    tries = 0  # a point that breaks a constraint is refused and counted

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int, grid: Grid, most: int) -> None:
        """Chooses the points.

        Args:
          dimension: number of axes.
          config: of scene optimizers.
          seed: of the sample.
          grid: of the scene space.
          most: number of points that are played, if the grid has more.
        """
        super().__init__(dimension, config, seed)
        self._grid = grid
        self.points = min(grid.size, most)
        self._order = grid_sample(grid, self.points, seed)
        self._drawn = 0

    def ask(self) -> Floats:
        """Returns the middle of the next point's cell, `d`, in [0, 1]."""
        levels = self._grid.levels(self._order[self._drawn % len(self._order)])
        self._drawn += 1
        return np.array([(level + 0.5) / axis.size for level, axis in zip(levels, self._grid.axes, strict=True)])

    def scene(self, point: Floats, space: SceneSpace) -> Scene:
        """Returns the scene of an asked point, with exactly the grid's values."""
        levels = tuple(int(u * axis.size) for u, axis in zip(point, self._grid.axes, strict=True))
        bounds = {parameter.name: (parameter.low, parameter.high) for parameter in space.parameters}
        values = self._grid.of_levels(levels).items()
        return Scene(space.family, {name: min(max(value, bounds[name][0]), bounds[name][1]) for name, value in values})

    def state(self) -> State:
        """See `SceneOptimizer.state`."""
        return {**super().state(), "drawn": self._drawn, "points": self.points}

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        super().load(state)
        if state["points"] != self.points:
            raise CheckpointError(f"the state is of a grid's {state['points']} points; wanted {self.points}")
        self._drawn = state["drawn"]


def grid_sample(grid: Grid, count: int, seed: int) -> list[int]:
    """Chooses points of a grid, each once; all of them in order.

    A sample is of the cells that a scrambled Sobol sequence falls into: each level of each axis gets its share of it.
    Of more than half of the points, those left out are drawn like this.

    Args:
      grid: of which any size is allowed.
      count: up to the grid's size.
      seed: of the sample.
    """
    if count == grid.size:
        return list(range(grid.size))
    if 2 * count > grid.size:
        left_out = set(grid_sample(grid, grid.size - count, seed))
        return [number for number in range(grid.size) if number not in left_out]
    counts = np.array([axis.size for axis in grid.axes])
    chosen = dict[int, None]()
    for batch in itertools.count():
        cells = (sobol_points(len(grid.axes), seed, batch * BATCH, BATCH).numpy() * counts).astype(np.int64)
        for levels in np.minimum(cells, counts - 1).tolist():
            chosen[grid.number(tuple(levels))] = None
            if len(chosen) == count:
                return list(chosen)
    raise AssertionError("unreachable")
