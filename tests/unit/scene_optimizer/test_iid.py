import numpy as np
import pytest
import scipy.stats

from risk_sac.config import SceneOptimizerConfig
from risk_sac.errors import CheckpointError
from risk_sac.scene_optimizer import IidSampler

CONFIG = SceneOptimizerConfig()


def asked(sampler, count):
    return np.array([sampler.ask() for _ in range(count)])


def test_scenes_are_uniform_and_do_not_depend_on_each_other():
    points = asked(IidSampler(3, CONFIG, 2**31 + 5), 2000)
    for axis in points.T:
        assert scipy.stats.kstest(axis, "uniform").pvalue > 0.001
        assert abs(np.corrcoef(axis[1:], axis[:-1])[0, 1]) < 0.08
    # A Sobol sequence would put nearly as many into each cell of a grid; chance does not.
    cells = np.histogramdd(points, bins=5)[0]
    assert 0.7 < cells.var() / cells.mean() < 1.4


def test_what_comes_of_a_scene_changes_no_other_and_another_seed_changes_all():
    told, silent, other = IidSampler(2, CONFIG, 1), IidSampler(2, CONFIG, 1), IidSampler(2, CONFIG, 2)
    points = []
    for episode in range(5):
        points.append(told.ask())
        assert told.tell(points[-1], [None, 3.0][episode % 2]) is None
    np.testing.assert_array_equal(points, asked(silent, 5))
    assert not np.isin(points, asked(other, 5)).any()


def test_it_goes_on_where_it_was():
    whole, first, rest = (IidSampler(2, CONFIG, 1) for _ in range(3))
    expected = asked(whole, 6)
    asked(first, 4)
    rest.load(first.state())
    np.testing.assert_array_equal(asked(rest, 2), expected[4:])
    with pytest.raises(CheckpointError, match="seed is 1"):
        IidSampler(2, CONFIG, 3).load(first.state())
