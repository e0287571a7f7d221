"""What strikes from one side strikes from the other side as often."""

import numpy as np
import pytest

from risk_sac.config import RunSpec, SceneOptimizerConfig
from risk_sac.env.problem import Problem
from risk_sac.records import Grade
from risk_sac.scenario.families import FAMILIES
from risk_sac.search.encounter import Encounter
from risk_sac.search.prior.coordinates import Coordinates
from risk_sac.search.prior.start import start_of
from risk_sac.search.scene_optimizer import ArchiveOptimizer
from risk_sac.search.scripts import SIZE
from risk_sac.search.searchers import Searchers
from tests.builders import collision, judgement

HIT = collision(other_id="left", verdicts={"ego_moving": True}, judgement=judgement(Grade.PREVENTABLE))
LOW = Coordinates.of(FAMILIES["low"])


def problem(family: str = "low") -> Problem:
    return Problem.from_spec(RunSpec(family=family, method="risk-sac-diverse", seed=0))


def genes_of(points: np.ndarray, adversary: str) -> np.ndarray:
    first = LOW.space.dimension + SIZE * LOW.adversaries.index(adversary)
    return points[:, first : first + SIZE]


def test_the_mirror_exchanges_the_neighbours_and_their_scripts():
    points = np.random.default_rng(0).random((5, LOW.dimension))
    mirrored, names = LOW.reflected(points), LOW.space.names
    np.testing.assert_allclose(genes_of(mirrored, "left"), genes_of(points, "right"))
    np.testing.assert_allclose(genes_of(mirrored, "lead"), genes_of(points, "lead"))
    own, other = (names.index(f"{side}_offset_m") for side in ("left", "right"))
    np.testing.assert_allclose(mirrored[:, own], points[:, other])
    np.testing.assert_allclose(LOW.reflected(mirrored), points)


@pytest.mark.parametrize("family", ["mixed", "dense"])
def test_other_families_have_no_mirror(family):
    assert not Coordinates.of(FAMILIES[family]).symmetric


def test_the_library_holds_each_row_and_its_mirror_image():
    library = start_of(problem(), "shipped").library
    half = len(library) // 2
    np.testing.assert_allclose(LOW.reflected(library[:half]), library[half:])


def test_the_model_predicts_the_same_for_both_sides():
    start = start_of(problem(), "shipped")
    points = np.random.default_rng(1).random((20, LOW.dimension))
    for own, other in zip(
        start.model.predict(points, start.belief),
        start.model.predict(LOW.reflected(points), start.belief),
        strict=True,
    ):
        np.testing.assert_allclose(own, other, atol=1e-6)


def test_children_of_an_elite_attack_from_both_sides():
    archive = ArchiveOptimizer(LOW.dimension, SceneOptimizerConfig(), 3)
    archive.initial, archive.reflect = 1, LOW.reflected
    parent, sides = archive.ask(), []
    archive.tell(parent, 0.0, Encounter(collision=HIT))
    for _ in range(200):
        child = archive.ask()
        near = [np.abs(child - point).mean() for point in (parent, LOW.reflected(parent[None])[0])]
        sides.append(near[0] < near[1])
        archive.tell(child, 0.0)
    assert 70 < sum(sides) < 130


def test_searches_of_low_get_the_mirror_and_others_do_not():
    for family, has_mirror in (("low", True), ("mixed", False)):
        spec = RunSpec(family=family, method="archive", seed=1)
        sampler = Searchers(spec, Problem.from_spec(spec), 1, 1).next(learning=True).sampler
        assert isinstance(sampler, ArchiveOptimizer)
        assert (sampler.reflect is not None) == has_mirror
