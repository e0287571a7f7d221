from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from risk_sac.config import Interval, RunSpec
from risk_sac.env.problem import Problem
from risk_sac.scenario import car_following
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.family import Family
from risk_sac.scenario.place import PLACES, Stretch
from risk_sac.search.prior.coordinates import Coordinates, Translation
from risk_sac.search.prior.shipped import inputs_of, shipped_prior
from risk_sac.search.prior.start import start_of
from risk_sac.search.scripts import SIZE, Genes


def low_with(*sides: str) -> Family:
    """The pattern of low where there is no lane on the other sides."""
    place = PLACES.validate_json((Path(str(files("sumo_nets"))) / "low" / "place.json").read_bytes())
    assert isinstance(place, Stretch)
    gone = {side: None for side in ("left", "right") if side not in sides}
    return car_following.family("car_following_000000000000", place.model_copy(update=gone))


def problem_at(family: Family) -> Problem:
    problem = Problem.from_spec(RunSpec(family="low", method="risk-sac-diverse", seed=0))
    return replace(problem, family=family, space=family.space)


def translation(family: Family, shipped: str) -> Translation:
    return Translation(Coordinates.of(family), Coordinates.of(FAMILIES[shipped]))


def genes_of(points: np.ndarray, family: Family, adversary: str) -> np.ndarray:
    first = family.space.dimension + SIZE * family.adversaries.index(adversary)
    return points[:, first : first + SIZE]


def test_points_of_a_narrower_problem_keep_their_values():
    family = FAMILIES["low"]
    first = family.space.parameters[0]
    middle = (first.low + first.high) / 2
    narrow = replace(family, space=family.space.narrow({first.name: Interval(low=middle, high=first.high)}))
    subject = translation(narrow, "low")
    point = np.full((1, inputs_of("low")), 0.5)
    known = subject.known(point)
    assert known[0, 0] == pytest.approx(0.75)
    np.testing.assert_allclose(subject.own(known), point)


def test_an_adversary_that_the_place_lacks_is_passive_to_the_model():
    place = low_with("left")
    subject = translation(place, "low")
    point = np.full((1, subject.scene_size + SIZE * 2), 0.9)
    known = subject.known(point)
    assert genes_of(known, FAMILIES["low"], "right")[0, 0] == 0.0
    assert (genes_of(known, FAMILIES["low"], "left") == 0.9).all()
    np.testing.assert_allclose(subject.own(known), point)


def test_scripts_from_the_left_are_played_from_the_right_where_there_is_no_lane_on_the_left():
    place = low_with("right")
    library = shipped_prior("low").library
    own = translation(place, "low").own(library)
    np.testing.assert_array_equal(genes_of(own, place, "right"), genes_of(library, FAMILIES["low"], "left"))
    offset, shipped = place.space.names.index("right_offset_m"), FAMILIES["low"].space.names.index("left_offset_m")
    np.testing.assert_allclose(own[:, offset], library[:, shipped])


def test_a_pedestrian_from_the_left_turns_the_other_way():
    mixed = FAMILIES["mixed"]
    library = shipped_prior("mixed").library
    subject = translation(replace(mixed, mirrored=True), "mixed")
    own = subject.own(library)
    steer, offset = Genes._fields.index("steer"), mixed.space.names.index("pedestrian_offset_m")
    there, here = genes_of(library, mixed, "pedestrian"), genes_of(own, mixed, "pedestrian")
    np.testing.assert_allclose(here[:, steer], 1.0 - there[:, steer])
    np.testing.assert_allclose(own[:, offset], 1.0 - library[:, offset])
    np.testing.assert_allclose(np.delete(here, steer, 1), np.delete(there, steer, 1))
    np.testing.assert_allclose(subject.known(own), library, atol=1e-12)


def test_rows_that_depend_on_a_missing_adversary_are_drawn_less_often():
    whole, alone = (start_of(problem_at(low_with(*sides)), "shipped") for sides in (("left", "right"), ()))
    assert whole.library_worth.mean() > 0.99
    assert alone.library_worth.mean() < 0.2
