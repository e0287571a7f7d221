"""Classifier of passing and failing, and boundary search, on known boundaries."""

import numpy as np
import pytest

from risk_sac.config import SceneOptimizerConfig
from risk_sac.config.campaign import BoundaryConfig
from risk_sac.scenario.declared import Slice
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.search.encounter import Encounter
from risk_sac.search.level_set import FailureClassifier, straddle
from risk_sac.search.scene_optimizer import BoundarySampler
from risk_sac.search.scene_optimizer.base import sobol_points

GRID = np.stack(np.meshgrid(*[np.linspace(0, 1, 20)] * 2, indexing="ij"), -1).reshape(-1, 2)


def circle(points):
    return np.hypot(points[:, 0] - 0.4, points[:, 1] - 0.55) < 0.3


def plane(points):
    return points @ np.array([1.0, 0.6]) < 0.7


def slice_over(names, holds=None):
    parameters = tuple(Parameter(name, "m", 0.0, 10.0, "") for name in ("a", "b", "c"))
    return Slice(SceneSpace("x", parameters, holds), BoundaryConfig(over=names), {})


def searched(fails, episodes, seed=0, slice_=None, refused=lambda point: False, out=0):
    """Asks with so many points out that are told later."""
    slice_ = slice_ or slice_over(("a", "b"))
    sampler = BoundarySampler(3, SceneOptimizerConfig(), seed, slice_)
    asked, waiting = [], []
    for _ in range(episodes):
        sampler.out = tuple(waiting)
        waiting.append(sampler.ask())
        asked.append(waiting[-1][list(slice_.columns)])
        if len(waiting) <= out:
            continue
        point = waiting.pop(0)
        unit = point[list(slice_.columns)]
        failed = bool(fails(unit[None])[0])
        margins = {"no_contact": -1.0 if failed else 1.0}
        violated = Encounter(margins=margins, avoided_by={"r157": not failed}, violations=(object(),) if failed else ())
        sampler.tell(point, None if refused(unit) else 0.0, violated)
    return np.array(asked), sampler


def balanced(guessed, truth):
    return (guessed[truth].mean() + (~guessed[~truth]).mean()) / 2


@pytest.mark.parametrize(
    ("fails", "out", "least"),
    [
        (circle, 0, 0.95),
        (plane, 15, 0.9),
        pytest.param(plane, 0, 0.95, marks=pytest.mark.torture),
        pytest.param(circle, 15, 0.9, marks=pytest.mark.torture),
    ],
)
def test_40_points_tell_a_grid_of_400(fails, out, least):
    asked, _ = searched(fails, 40, out=out)
    classifier = FailureClassifier(asked, fails(asked))
    assert balanced(classifier.probability(GRID) > 0.5, fails(GRID)) >= least


def test_most_points_lie_near_the_boundary():
    asked, _ = searched(circle, 30)
    off = np.abs(np.hypot(asked[:, 0] - 0.4, asked[:, 1] - 0.55) - 0.3)
    assert np.median(off[12:]) < 0.5 * np.median(off[:12])


def test_a_mirrored_problem_has_the_mirrored_map():
    points = sobol_points(2, 3, count=30).numpy()
    mirrored = points * (-1, 1) + (1, 0)
    one, other = FailureClassifier(points, circle(points)), FailureClassifier(mirrored, circle(points))
    np.testing.assert_allclose(one.probability(GRID), other.probability(GRID * (-1, 1) + (1, 0)), atol=0.02)


def test_the_interval_of_the_area_has_the_true_area():
    points = sobol_points(2, 1, count=60).numpy()
    box = sobol_points(2, 5, count=500).numpy()
    shares = (FailureClassifier(points, plane(points)).samples(box, 200, 0) > 0).mean(axis=1)
    low, high = np.quantile(shares, (0.025, 0.975))
    assert low <= plane(box).mean() <= high
    assert high - low < 0.15


def test_what_is_known_is_less_ambiguous_than_what_is_not():
    points = sobol_points(2, 1, count=40).numpy() * (0.5, 1.0)  # nothing is known on the right
    classifier = FailureClassifier(points, plane(points))
    corner, inside = straddle(classifier, np.array([[0.98, 0.5], [0.05, 0.1]]))
    assert corner > inside


def test_points_that_are_out_leave_less_ambiguity_around_them_and_none_added():
    points = sobol_points(2, 1, count=40).numpy()
    classifier, out = FailureClassifier(points, plane(points)), np.array([[0.5, 0.4], [0.2, 0.9]])
    before, after = straddle(classifier, GRID), straddle(classifier, GRID, out)
    assert (after <= before + 1e-9).all()
    near, far = (np.abs(GRID - at).sum(axis=1) < 0.1 for at in (out[0], np.array([0.95, 0.05])))
    assert (before - after)[near].min() > 5 * (before - after)[far].max()


def test_an_outcome_that_is_awaited_tells_as_much_as_one_that_came():
    """The deviation follows the two-point formula with an outcome's variance."""
    points = sobol_points(2, 1, count=40).numpy()
    classifier, pair = FailureClassifier(points, plane(points)), np.array([[0.4, 0.5], [0.5, 0.5]])
    draws = classifier.samples(pair, 200_000, seed=0)
    (first, across), (_, second) = np.cov(draws.T)
    expected = np.sqrt(first - across**2 / (second + np.pi / 2))
    assert classifier.latent(pair[:1], pair[1:])[1] == pytest.approx(expected, rel=0.02)


def test_no_two_points_that_are_out_are_the_same():
    asked, _ = searched(circle, 44, out=15)
    apart = np.linalg.norm(asked[:, None] - asked[None], axis=2) + np.eye(len(asked))
    assert apart.min() > 0.005


def test_other_parameters_are_fixed_at_their_middle_and_the_order_of_names_is_kept():
    slice_ = slice_over(("c", "a"))
    np.testing.assert_allclose(slice_.whole(np.array([0.1, 0.9]), np.random.default_rng(0)), [0.9, 0.5, 0.1])
    np.testing.assert_allclose(slice_.units({"a": 9.0, "b": 5.0, "c": 1.0}), [0.1, 0.9])


def test_a_search_goes_on_where_its_state_was_taken():
    whole, _ = searched(circle, 16)
    _, sampler = searched(circle, 14)
    resumed = BoundarySampler(3, SceneOptimizerConfig(), 0, slice_over(("a", "b")))
    resumed.load(sampler.state())
    np.testing.assert_array_equal(resumed.ask()[:2], whole[14])


def test_scenes_that_break_a_constraint_are_not_asked_for():
    asked, _ = searched(circle, 18, slice_=slice_over(("a", "b"), holds=lambda scene: scene["a"] < 6.0))
    assert (asked[:, 0] < 0.6).all()


def test_refused_scenes_are_left_alone_once_they_are_known():
    asked, _ = searched(circle, 22, refused=lambda point: point[1] > 0.6)
    assert (asked[12:, 1] > 0.7).sum() <= 2


def test_without_an_outcome_of_either_class_the_space_is_filled():
    asked, _ = searched(lambda points: np.zeros(len(points), bool), 16)
    np.testing.assert_array_equal(asked, sobol_points(2, 0, count=16).numpy())
