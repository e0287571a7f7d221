"""Samplers of the user's, and those that ship."""

from pathlib import Path

import numpy as np
import pytest

from risk_sac.config import Budget, EgoConfig, RunSpec, SceneOptimizerConfig, method_of
from risk_sac.config.methods import SHIPPED, named_methods, sampler_of
from risk_sac.errors import ConfigError
from risk_sac.lab.peers import CrossEntropy
from risk_sac.records import Grade
from risk_sac.search.encounter import NO_ENCOUNTER, Encounter
from risk_sac.search.scene_optimizer import RegisteredSampler
from risk_sac.search.scene_optimizer.registered import REFUSED, score_of
from tests.builders import collision, judgement

DIMENSION = 5
METHODS = tuple(f"sampler-{name}" for name in SHIPPED)


def sampler(method: str, seed: int = 3) -> RegisteredSampler:
    return RegisteredSampler(DIMENSION, SceneOptimizerConfig(), seed, method)


def near(point: np.ndarray) -> Encounter:
    """Returns a pass with the distance to a corner, or a failure."""
    distance = float(np.linalg.norm(point - 0.1))
    struck = collision(judgement=judgement(Grade.UNAVOIDABLE)) if distance < 0.4 else None
    return Encounter(collision=struck, margins={"no_contact": 3 * distance})


class Raises:
    """Raises when it is told."""

    def __init__(self, dimension: int, seed: int) -> None:
        self.dimension = dimension

    def ask(self) -> np.ndarray:
        return np.full(self.dimension, 0.5)

    def tell(self, point: np.ndarray, score: float) -> None:
        raise RuntimeError("disk on fire")


class Leaves(Raises):
    """Leaves the unit cube."""

    def ask(self) -> np.ndarray:
        return np.full(self.dimension, 1.5)


def test_a_pass_has_half_a_point_each_for_margin_and_encounter():
    assert score_of(NO_ENCOUNTER) == pytest.approx(1.05)
    assert score_of(Encounter(margins={"a": 1.0, "b": 4.0}, encounters_s={"left": 2.0})) == pytest.approx(0.25)
    assert score_of(Encounter(margins={"a": -1.0}, encounters_s={"left": 0.0})) == pytest.approx(0.05)


def test_a_failure_is_below_zero_and_worse_the_faster():
    slow = collision(relative_speed_mps=5.0, judgement=judgement(Grade.UNAVOIDABLE))
    fast = collision(relative_speed_mps=30.0, judgement=judgement(Grade.UNAVOIDABLE))
    assert score_of(Encounter(collision=slow)) == pytest.approx(-1.125)
    assert score_of(Encounter(collision=fast)) == pytest.approx(-1.5)


def test_a_headline_candidate_is_lower_by_one():
    plain = collision(relative_speed_mps=5.0, judgement=judgement(Grade.PREVENTABLE))
    assert plain.headline_candidate
    assert score_of(Encounter(collision=plain)) == pytest.approx(-2.125)


def test_a_contact_that_does_not_count_is_half_a_pass():
    assert score_of(Encounter(collision=collision(verdicts={"ego_moving": False}))) == 0.5


@pytest.mark.parametrize("method", METHODS)
def test_a_sampler_that_ships_stays_in_the_cube_and_goes_on_where_it_was(method):
    first = sampler(method)
    for _ in range(70):
        point = first.ask()
        first.tell(point, 0.1, near(point))
    again = sampler(method)
    again.load(first.state())
    for _ in range(40):
        point = first.ask()
        assert ((point >= 0) & (point <= 1)).all()
        np.testing.assert_array_equal(again.ask(), point)
        for one in (first, again):
            one.tell(point, None if point[0] > 0.9 else 0.1, near(point))


@pytest.mark.parametrize("method", METHODS)
def test_a_sampler_that_ships_plays_rounds_and_goes_on_between_them(method):
    first, out, points = sampler(method), [], 0
    for _ in range(20):
        while len(out) < 8 and not first.waits(len(out)):
            out.append(first.ask())
        points += len(out)
        again = sampler(method)
        again.load(first.state())
        assert len(np.unique(out, axis=0)) == len(out)
        for _ in range(min(len(out), 5)):
            point = out.pop(0)
            for one in (first, again):
                one.tell(point, 0.1, near(point))
        assert first.state() == again.state()
        if not first.waits(len(out)):
            out.append(first.ask())
            np.testing.assert_array_equal(again.ask(), out[-1])
    assert points > 60  # several at a time


def test_a_sampler_that_does_not_say_so_plays_one_point_at_a_time(monkeypatch):
    monkeypatch.setitem(SHIPPED, "bad", (f"{__name__}:Raises", ""))
    one = sampler("sampler-bad")
    assert not one.waits(0)
    assert one.waits(1)


@pytest.mark.parametrize("method", [name for name in METHODS if name != "sampler-uniform"])
def test_a_sampler_that_ships_finds_more_than_uniform_points(method):
    def failures(name: str) -> int:
        count = 0
        for one in (sampler(name, seed) for seed in range(3)):
            for _ in range(300):
                point = one.ask()
                encounter = near(point)
                one.tell(point, 0.1, encounter)
                count += encounter.collision is not None
        return count

    assert failures(method) > 1.5 * failures("sampler-uniform")


def test_cross_entropy_moves_a_tenth_of_its_mass_to_what_failed():
    one = CrossEntropy(2, 0)
    one.tell(np.array([0.05, 0.99]), -1.0)
    np.testing.assert_allclose(one._shares, [[0.28, 0.18, 0.18, 0.18, 0.18], [0.18, 0.18, 0.18, 0.18, 0.28]])
    one.tell(np.array([0.5, 0.5]), 0.3)
    assert one._shares[0, 0] == pytest.approx(0.28)


def test_a_refused_scene_is_told_as_the_worst(monkeypatch):
    told = []
    monkeypatch.setattr("risk_sac.lab.peers.Uniform.tell", lambda self, point, score: told.append(score))
    one = sampler("sampler-uniform")
    one.tell(one.ask(), None)
    assert told == [REFUSED]


@pytest.mark.parametrize(("name", "said"), [("Raises", "disk on fire"), ("Leaves", "coordinates in")])
def test_a_sampler_that_fails_is_named(monkeypatch, name, said):
    monkeypatch.setitem(SHIPPED, "bad", (f"{__name__}:{name}", ""))
    one = sampler("sampler-bad")
    with pytest.raises(ConfigError, match=f"sampler-bad.*{said}|{said}.*sampler-bad"):
        one.tell(one.ask(), 0.1)


def test_the_example_of_the_page_climbs(monkeypatch, tmp_path):
    page = Path("risk_sac/search/samplers.md").read_text(encoding="utf-8")
    (tmp_path / "hill_of_the_page.py").write_text(page.split("```python\n")[1].split("```")[0])
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(SHIPPED, "hill", ("hill_of_the_page:HillClimber", ""))
    one = sampler("sampler-hill")
    distances = []
    for _ in range(100):
        point = one.ask()
        one.tell(point, 0.1, near(point))
        distances.append(float(np.linalg.norm(point - 0.1)))
    assert np.mean(distances[-20:]) < 0.7 * np.mean(distances[:5])


def test_a_method_without_a_sampler_is_refused_by_name():
    with pytest.raises(ConfigError, match=r"sampler-tp'.*sampler-tpe"):
        sampler_of("sampler-tp")


def test_a_sampler_whose_package_is_missing_says_what_to_install(monkeypatch):
    monkeypatch.setitem(SHIPPED, "tpe", ("risk_sac.lab.peers:Tpe", "not_installed_at_all"))
    assert "sampler-tpe" not in named_methods()
    with pytest.raises(ConfigError, match=r"not_installed_at_all.*risk-sac.peers."):
        sampler_of("sampler-tpe")


def test_a_sampler_drives_the_scripts_of_the_archive_search():
    spec = RunSpec(family="low", method="sampler-uniform", seed=0, budget=Budget(episodes=1), ego=EgoConfig())
    method = method_of(spec.method)
    assert (method.agent, method.scenes) == ("scripts", "registered")
