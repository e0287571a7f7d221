import io

import numpy as np
import pytest

from risk_sac.config import RunSpec, SceneOptimizerConfig
from risk_sac.env.problem import Problem
from risk_sac.errors import CheckpointError, ConfigError
from risk_sac.scenario.reading import PAPER_FAMILIES
from risk_sac.search.prior.files import DATA, MOST_BYTES
from risk_sac.search.prior.policy import POLICY
from risk_sac.search.prior.sampler import Arm, PriorOptimizer, Yields
from risk_sac.search.prior.script_model import PlacedModel
from risk_sac.search.prior.shipped import (
    MODEL,
    inputs_of,
    read_library,
    read_model,
    shipped_library,
    shipped_model,
    write_library,
    write_model,
)
from risk_sac.search.prior.start import start_of
from risk_sac.search.prior.tokens import Tokenizer

FAMILY = "low"


def problem(seed: int = 1) -> Problem:
    return Problem.from_spec(RunSpec(family=FAMILY, method="risk-sac-diverse", seed=seed))


def placed_model() -> PlacedModel:
    return start_of(problem(), "shipped").model


def optimizer(kind: type[PriorOptimizer] = PriorOptimizer, seed: int = 1) -> PriorOptimizer:
    return kind(inputs_of(FAMILY), SceneOptimizerConfig(), seed, start_of(problem(seed), "shipped"))


def test_what_ships_is_a_model_and_a_library_for_each_family_of_the_paper():
    assert {path.name for path in DATA.glob("*.npz")} == {
        MODEL,
        *(f"{family}.npz" for family in PAPER_FAMILIES),
        POLICY,
    }
    assert sum(path.stat().st_size for path in DATA.glob("*.npz")) <= MOST_BYTES
    for family in PAPER_FAMILIES:
        shipped = shipped_library(family)
        assert shipped.points.shape == (len(shipped.kinds), inputs_of(family))
        assert len(shipped.points) <= 300


def test_the_test_set_and_planners_are_not_among_the_training_egos():
    from risk_sac.egos.defects.catalogue import DEFECTS

    egos = set(shipped_model().egos)
    assert not egos & {name for name, defect in DEFECTS.items() if defect.test_set}
    assert not egos & {"fop", "fiss", "fiss-plus"}


def test_model_and_library_are_read_as_they_were_written(tmp_path):
    batch = Tokenizer(problem()).batch(shipped_library(FAMILY).points[:20])
    write_model(tmp_path / MODEL, shipped_model(), {})
    again, unknown = read_model(tmp_path / MODEL), shipped_model().unknown()
    np.testing.assert_array_equal(again.predict(batch, unknown).fails, shipped_model().predict(batch, unknown).fails)
    write_library(tmp_path / "low.npz", shipped_library(FAMILY))
    library = read_library(tmp_path / "low.npz")
    np.testing.assert_array_equal(library.points, shipped_library(FAMILY).points)
    np.testing.assert_array_equal(library.fails, shipped_library(FAMILY).fails)
    assert library.kinds == shipped_library(FAMILY).kinds


def test_damaged_oversized_and_pickled_files_are_refused_with_one_line(tmp_path):
    whole = (DATA / MODEL).read_bytes()
    pickled = io.BytesIO()
    np.savez(pickled, meta=np.array([{"family": "low"}], dtype=object))
    for name, content in {
        "damaged": whole[: len(whole) // 2],
        "empty": b"",
        "pickled": pickled.getvalue(),
        "oversized": b"0" * (MOST_BYTES + 1),
        "a library": (DATA / "low.npz").read_bytes(),
    }.items():
        path = tmp_path / f"{name}.npz"
        path.write_bytes(content)
        with pytest.raises(ConfigError, match=f"{name}.npz") as refused:
            read_model(path)
        assert "\n" not in str(refused.value)
    with pytest.raises(ConfigError):
        read_library(DATA / MODEL)


def test_a_belief_moves_to_egos_that_would_have_failed_too():
    model, points = placed_model(), shipped_library(FAMILY).points[:1]
    unknown = model.unknown()
    each = model.predict(np.repeat(points, len(unknown), 0), np.eye(len(unknown))).fails
    failed, safe = (model.believe(unknown, points, np.array([end])) for end in (True, False))
    assert failed.sum() == pytest.approx(1.0)
    assert failed[each.argmax()] > 1.0 / len(unknown) > failed[each.argmin()]
    assert safe[each.argmin()] > 1.0 / len(unknown) > safe[each.argmax()]


def test_a_belief_after_two_episodes_is_that_after_one_and_then_the_other():
    model, points, ends = placed_model(), shipped_library(FAMILY).points[:2], np.array([True, False])
    belief = model.unknown()
    for point, end in zip(points, ends, strict=True):
        belief = model.believe(belief, point[None], np.array([end]))
    np.testing.assert_allclose(model.believe(model.unknown(), points, ends), belief)


def test_it_goes_on_from_its_state_exactly():
    subject = optimizer()
    for _ in range(10):
        subject.tell(subject.ask(), 0.0)
    again = optimizer()
    again.load(subject.state())
    for _ in range(10):
        one, other = subject.ask(), again.ask()
        np.testing.assert_array_equal(one, other)
        subject.tell(one, 0.0)
        again.tell(other, 0.0)


def test_a_state_with_other_weights_is_refused():
    with pytest.raises(CheckpointError, match="weights"):
        optimizer().load(optimizer().state() | {"weights": "of another release"})


@pytest.mark.parametrize(("trust", "at_first", "later"), [(1.0, 0.2, 0.4), (0.1, 0.6, 0.6)])
def test_a_useless_prior_loses_its_share_and_soon_where_it_is_not_trusted(trust, at_first, later):
    shares = []
    for seed in range(20):
        random, subject, drawn = np.random.default_rng(seed), Yields(tuple(Arm), trust), []
        for _ in range(150):
            drawn.append(subject.draw(random))
            subject.tell(drawn[-1], float(drawn[-1] is Arm.ARCHIVE and random.random() < 0.1))
        shares.append([np.mean([arm is Arm.ARCHIVE for arm in part]) for part in (drawn[:50], drawn[75:])])
    first, last = np.mean(shares, 0)
    assert first > at_first
    assert last > later
