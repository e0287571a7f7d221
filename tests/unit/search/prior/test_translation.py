from dataclasses import replace

import numpy as np
import pytest

from risk_sac.config import METHODS, Interval, Like, RunSpec
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.scenario import library
from risk_sac.scenario.families import FAMILIES, Family, family_of
from risk_sac.scenario.reading import nets_of, shipped_document
from risk_sac.search.prior.coordinates import Coordinates
from risk_sac.search.prior.shipped import inputs_of, shipped_library
from risk_sac.search.prior.start import start_of
from risk_sac.search.scripts import SIZE, Genes
from risk_sac.search.searchers import Searchers


def low_with(*sides: str) -> Family:
    """Scenario low with vehicles on these sides; mirrored if right alone."""
    document = shipped_document("low")
    gone = {side for side in ("left", "right") if side not in sides}
    parameters = {name: each for name, each in document.parameters.items() if name.partition("_")[0] not in gone}
    actors = {name: actor for name, actor in document.actors.items() if name not in gone}
    like = Like(family="low", mirrored=sides == ("right",))
    return family_of(
        document.model_copy(update={"name": "narrow", "parameters": parameters, "actors": actors, "like": like}),
        nets_of(document),
    )


def problem_at(family: Family) -> Problem:
    problem = Problem.from_spec(RunSpec(family="low", method="risk-sac-diverse", seed=0))
    return replace(problem, family=family, space=family.space)


def translated(points: np.ndarray, source: Family, target: Family) -> np.ndarray:
    return Coordinates.of(target).placed(Coordinates.of(source).scripted(points))


def genes_of(points: np.ndarray, family: Family, adversary: str) -> np.ndarray:
    first = family.space.dimension + SIZE * family.adversaries.index(adversary)
    return points[:, first : first + SIZE]


def test_points_of_a_narrower_problem_keep_their_values():
    family = FAMILIES["low"]
    first = family.space.parameters[0]
    middle = (first.low + first.high) / 2
    narrow = replace(family, space=family.space.narrow({first.name: Interval(low=middle, high=first.high)}))
    point = np.full((1, inputs_of("low")), 0.5)
    known = translated(point, narrow, family)
    assert known[0, 0] == pytest.approx(0.75)
    np.testing.assert_allclose(translated(known, family, narrow), point)


def test_an_adversary_that_one_side_lacks_is_passive():
    place = low_with("left")
    point = np.full((1, place.space.dimension + SIZE * 2), 0.9)
    known = translated(point, place, FAMILIES["low"])
    assert genes_of(known, FAMILIES["low"], "right")[0, 0] == 0.0
    assert (genes_of(known, FAMILIES["low"], "left") == 0.9).all()
    np.testing.assert_allclose(translated(known, FAMILIES["low"], place), point)


def test_scripts_from_the_left_are_played_from_the_right_where_there_is_no_lane_on_the_left():
    place = low_with("right")
    rows = shipped_library("low").points
    own = translated(rows, FAMILIES["low"], place)
    np.testing.assert_array_equal(genes_of(own, place, "right"), genes_of(rows, FAMILIES["low"], "left"))
    offset, shipped = place.space.names.index("right_offset_m"), FAMILIES["low"].space.names.index("left_offset_m")
    np.testing.assert_allclose(own[:, offset], rows[:, shipped])


def test_a_pedestrian_from_the_left_turns_the_other_way():
    mixed = FAMILIES["mixed"]
    rows = shipped_library("mixed").points
    mirrored = replace(mixed, like=Like(family="mixed", mirrored=True))
    own = translated(rows, mixed, mirrored)
    steer, offset = Genes._fields.index("steer"), mixed.space.names.index("pedestrian_offset_m")
    there, here = genes_of(rows, mixed, "pedestrian"), genes_of(own, mixed, "pedestrian")
    np.testing.assert_allclose(here[:, steer], 1.0 - there[:, steer])
    np.testing.assert_allclose(own[:, offset], 1.0 - rows[:, offset])
    np.testing.assert_allclose(np.delete(here, steer, 1), np.delete(there, steer, 1))
    np.testing.assert_allclose(translated(own, mirrored, mixed), rows, atol=1e-12)


def test_actors_take_the_scripts_of_those_that_they_stand_for():
    document = shipped_document("low")
    actors = {"truck" if name == "left" else name: actor for name, actor in document.actors.items()}
    like = Like(family="low", actors={"truck": "left"})
    family = family_of(document.model_copy(update={"actors": actors, "like": like}), nets_of(document))
    rows = shipped_library("low").points
    own = translated(rows, FAMILIES["low"], family)
    np.testing.assert_array_equal(genes_of(own, family, "truck"), genes_of(rows, FAMILIES["low"], "left"))
    np.testing.assert_allclose(translated(own, family, FAMILIES["low"]), rows, atol=1e-12)


@pytest.mark.parametrize(
    ("like", "field"),
    [
        (Like(family="high"), "like.family"),
        (Like(family="low"), "like.actors.occluder"),
        (Like(family="mixed", actors={"occluder": "pedestrian"}), "like.actors.occluder"),
        (Like(family="mixed", actors={"follower": "occluder"}), "like.actors.follower"),
    ],
)
def test_a_prior_that_does_not_fit_is_refused(like, field):
    document = shipped_document("mixed")
    with pytest.raises(ConfigError) as refused:
        family_of(document.model_copy(update={"like": like}), nets_of(document))
    assert refused.value.field == field


@pytest.mark.parametrize("method", [name for name in METHODS if name != "boundary"])
def test_a_scenario_without_like_has_a_model_and_no_library_and_every_method_searches_it(method, tmp_path, monkeypatch):
    if METHODS[method].needs:
        pytest.importorskip(METHODS[method].needs)
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    name = library.keep(shipped_document("mixed").model_copy(update={"like": None}), {})
    spec = RunSpec(family=name, method=method, seed=0)
    problem = Problem.from_spec(spec)
    assert len(start_of(problem, "shipped").library) == 0
    searchers = Searchers(spec, problem, problem.observation_size, problem.action_size)
    assert searchers.next(learning=True).sampler.ask().shape[-1] >= problem.space.dimension


def test_rows_that_depend_on_a_missing_adversary_are_drawn_less_often():
    whole, alone = (start_of(problem_at(low_with(*sides)), "shipped") for sides in (("left", "right"), ()))
    assert whole.library_worth.mean() > 0.99
    assert alone.library_worth.mean() < 0.5
