import io

import numpy as np
import pytest

from risk_sac.config import RunSpec, SceneOptimizerConfig
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.scenario.shipped import PAPER_FAMILIES
from risk_sac.search.prior.files import DATA, MOST_BYTES
from risk_sac.search.prior.sampler import Arm, PriorOptimizer, Yields
from risk_sac.search.prior.shipped import Prior, inputs_of, read_prior, shipped_prior, write_prior
from risk_sac.search.prior.start import start_of

FAMILY = "low"


def shipped() -> Prior:
    return shipped_prior(FAMILY)


def optimizer(kind: type[PriorOptimizer] = PriorOptimizer, seed: int = 1) -> PriorOptimizer:
    problem = Problem.from_spec(RunSpec(family=FAMILY, method="risk-sac-diverse", seed=seed))
    return kind(inputs_of(FAMILY), SceneOptimizerConfig(), seed, start_of(problem, "shipped"))


def test_a_prior_is_shipped_for_each_family_within_three_megabytes():
    assert {path.stem for path in DATA.glob("*.npz")} == {*PAPER_FAMILIES, "low-policy", "mixed-policy"}
    assert sum(path.stat().st_size for path in DATA.glob("*.npz")) <= MOST_BYTES
    for family in PAPER_FAMILIES:
        prior = shipped_prior(family)
        assert prior.library.shape == (len(prior.library_kinds), inputs_of(family))
        assert len(prior.library) <= 300


def test_the_test_set_and_planners_are_not_among_the_training_egos():
    from risk_sac.egos.defects.catalogue import DEFECTS

    for family in PAPER_FAMILIES:
        prior = shipped_prior(family)
        egos = set(prior.model.egos)
        assert not egos & {name for name, defect in DEFECTS.items() if defect.test_set}
        assert not egos & {"fop", "fiss", "fiss-plus"}


def test_a_prior_is_read_as_it_was_written(tmp_path):
    write_prior(tmp_path / "low.npz", shipped())
    again = read_prior(tmp_path / "low.npz")
    points = shipped().library[:20]
    np.testing.assert_array_equal(
        again.model.predict(points, again.model.unknown()).fails,
        shipped().model.predict(points, shipped().model.unknown()).fails,
    )


def test_damaged_oversized_and_pickled_files_are_refused_with_one_line(tmp_path):
    whole = (DATA / "low.npz").read_bytes()
    pickled = io.BytesIO()
    np.savez(pickled, meta=np.array([{"family": "low"}], dtype=object))
    for name, content in {
        "damaged": whole[: len(whole) // 2],
        "empty": b"",
        "pickled": pickled.getvalue(),
        "oversized": b"0" * (MOST_BYTES + 1),
    }.items():
        path = tmp_path / f"{name}.npz"
        path.write_bytes(content)
        with pytest.raises(ConfigError, match=f"{name}.npz") as refused:
            read_prior(path)
        assert "\n" not in str(refused.value)


def test_a_belief_moves_to_egos_that_would_have_failed_too():
    model = shipped().model
    point = shipped().library[0]
    each = model.predict(np.repeat(point[None], len(model.egos), 0), np.eye(len(model.egos))).fails
    failed = model.believe(model.unknown(), point, failed=True)
    safe = model.believe(model.unknown(), point, failed=False)
    assert failed.sum() == pytest.approx(1.0)
    assert failed[each.argmax()] > 1.0 / len(model.egos) > failed[each.argmin()]
    assert safe[each.argmin()] > 1.0 / len(model.egos) > safe[each.argmax()]


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
