"""The script model sees actors as a set, as at the release."""

import math

import numpy as np
import pytest

from risk_sac.config import RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.observation_layout import LIMIT, Y_M
from risk_sac.env.problem import Problem
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.layout import LEAD_IN_S
from risk_sac.scenario.reading import shipped_names
from risk_sac.search.prior.shipped import shipped_model
from risk_sac.search.prior.tokens import TokenBatch, Tokenizer, placed
from risk_sac.search.scripts import SIZE, adversaries_seen

ASIDE_M = LIMIT * Y_M  # bound of an observation
BEHIND_M = 3.0  # the first observation comes a step after the release


def problem(family: str) -> Problem:
    return Problem.from_spec(RunSpec(family=family, method="archive", seed=0))


def points(of: Problem, count: int = 12) -> np.ndarray:
    size = of.space.dimension + SIZE * len(of.family.adversaries)
    return np.random.default_rng(4).random((count, size))


def fails(batch: TokenBatch) -> np.ndarray:
    model = shipped_model()
    return model.predict(batch, model.unknown()).fails


@pytest.mark.parametrize("family", ["dense", "left_turn_car", "pedestrian_at_night"])
def test_actors_are_placed_where_the_simulation_has_them_at_the_release(family):
    env = RiskSacEnv.of(RunSpec(family=family, method="archive", seed=0))
    try:
        scene = env.problem.space.from_unit(np.full(env.problem.space.dimension, 0.4))
        observation, _ = env.reset(seed=1, options={"scene": scene})
        names = env.problem.family.adversaries
        seen = dict(zip(names, adversaries_seen(observation, len(names), 0), strict=True))
        layout = env.problem.family.layout(scene.values)
        net = net_of(layout.net)
        ego, *others = [
            placed(net, layout, start, LEAD_IN_S) for start in (layout.ego, *layout.vehicles, *layout.pedestrians)
        ]
        cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
        compared = 0
        for other in others:
            one = seen.get(other.start.id)
            if one is None:
                continue
            dx, dy = other.x_m - ego.x_m, other.y_m - ego.y_m
            assert dx * cos + dy * sin == pytest.approx(one.x_m, abs=BEHIND_M)
            assert np.clip(dy * cos - dx * sin, -ASIDE_M, ASIDE_M) == pytest.approx(one.y_m, abs=BEHIND_M)
            assert math.cos(other.heading_rad - ego.heading_rad) == pytest.approx(one.cos, abs=0.05)
            assert other.speed_mps == pytest.approx(one.speed_mps, abs=1.0)
            compared += 1
        assert compared == len(names)
    finally:
        env.close()


@pytest.mark.parametrize("family", shipped_names())
def test_every_shipped_scenario_has_predictions(family):
    of = problem(family)
    batch = Tokenizer(of).batch(points(of))
    assert batch.playable.any()
    assert batch.present[batch.playable].any(axis=1).all()
    assert np.isfinite(fails(batch)).all()
    assert np.ptp(fails(batch)[batch.playable]) > 0.0


def test_the_order_of_the_actors_makes_no_difference():
    of = problem("dense")
    batch = Tokenizer(of).batch(points(of))
    order = np.random.default_rng(0).permutation(batch.present.shape[1])
    by_actor = {name: getattr(batch, name)[:, order] for name in ("actors", "scripts", "present", "turns")}
    np.testing.assert_allclose(fails(batch._replace(**by_actor)), fails(batch), atol=1e-6)


def test_a_mirror_makes_no_difference_and_one_script_turned_round_does():
    of = problem("left_turn_car")
    batch = Tokenizer(of).batch(points(of))
    mirrored = batch.mirrored()
    assert not np.allclose(mirrored.actors, batch.actors)
    np.testing.assert_allclose(fails(mirrored), fails(batch), atol=1e-6)
    assert not np.allclose(fails(batch._replace(scripts=mirrored.scripts)), fails(batch), atol=1e-6)


def test_the_genes_of_an_adversary_that_does_nothing_make_no_difference():
    of = problem("low")
    at, other = points(of), np.random.default_rng(9)
    first = of.space.dimension
    at[:, first : first + SIZE], at[:, first + SIZE] = other.random((len(at), SIZE)), 0.9
    at[:, first] = 0.1
    changed = at.copy()
    changed[:, first + 1 : first + SIZE] = other.random((len(at), SIZE - 1))
    subject = Tokenizer(of)
    np.testing.assert_array_equal(fails(subject.batch(changed)), fails(subject.batch(at)))
    changed[:, first] = 0.9
    assert not np.array_equal(fails(subject.batch(changed)), fails(subject.batch(at)))


def test_a_scene_that_breaks_a_constraint_does_not_fail():
    of = problem("motorway_traffic")
    batch = Tokenizer(of).batch(points(of, 60))
    assert not batch.playable.all()
    assert (fails(batch)[~batch.playable] == 0.0).all()
    assert (fails(batch)[batch.playable] > 0.0).all()
