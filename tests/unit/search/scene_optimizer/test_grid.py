"""Samples of grids: stratified, without repetition, also of huge grids."""

import numpy as np
import pytest

from risk_sac.config import SceneOptimizerConfig
from risk_sac.errors import CheckpointError
from risk_sac.scenario.space import Grid, GridAxis, Parameter, SceneSpace
from risk_sac.search.scene_optimizer.grid import GridSampler, grid_sample


def grid(*sizes: int) -> Grid:
    return Grid(tuple(GridAxis(f"p{i}", size, 0.0, 0.1, True) for i, size in enumerate(sizes)))


def sampler(of: Grid, most: int, seed: int = 0) -> GridSampler:
    return GridSampler(len(of.axes), SceneOptimizerConfig(), seed, of, most)


def test_a_grid_within_the_budget_is_played_in_order_and_exactly():
    of = grid(3, 2)
    space = SceneSpace("made_up", tuple(Parameter(axis.name, "1", 0.0, 0.2, "") for axis in of.axes))
    made = sampler(of, 100)
    assert made.points == 6
    scenes = [made.scene(made.ask(), space).values for _ in range(7)]
    assert [tuple(scene.values()) for scene in scenes] == [
        (0.0, 0.0),
        (0.0, 0.1),
        (0.1, 0.0),
        (0.1, 0.1),
        (0.2, 0.0),
        (0.2, 0.1),
        (0.0, 0.0),
    ]


@pytest.mark.parametrize("count", [1, 24, 60, 119])
def test_a_sample_has_no_point_twice(count):
    of = grid(4, 5, 6)
    assert len(set(grid_sample(of, count, seed=3))) == count


def test_a_sample_is_stratified():
    """Each value of an axis gets its share of the 64 points."""
    of = grid(4, 8, 16)
    levels = np.array([of.levels(number) for number in grid_sample(of, 64, seed=1)])
    for axis, size in enumerate((4, 8, 16)):
        shares = np.bincount(levels[:, axis], minlength=size)
        assert abs(shares - 64 / size).max() <= 1


def test_a_grid_of_a_billion_points_is_sampled():
    of = grid(*[1000] * 3, 1)
    sample = grid_sample(of, 500, seed=0)
    assert len(set(sample)) == 500
    assert max(sample) < of.size == 10**9
    assert sample != grid_sample(of, 500, seed=1)


def test_a_sampler_goes_on_where_its_state_was_taken():
    whole, first = sampler(grid(9, 9), 20), sampler(grid(9, 9), 20)
    points = [whole.ask() for _ in range(20)]
    for _ in range(8):
        first.ask()
    resumed = sampler(grid(9, 9), 20)
    resumed.load(first.state())
    np.testing.assert_array_equal([resumed.ask() for _ in range(12)], points[8:])
    with pytest.raises(CheckpointError):
        sampler(grid(9, 9), 21).load(first.state())
