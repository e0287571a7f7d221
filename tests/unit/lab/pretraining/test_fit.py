import numpy as np
import pytest

from risk_sac.config import RunSpec
from risk_sac.env.problem import Problem
from risk_sac.lab.pretraining import fit as fitting
from risk_sac.lab.pretraining.episodes import training_egos
from risk_sac.lab.pretraining.fit import Dataset, auc, beliefs, fitted_prior
from risk_sac.search.prior.shipped import inputs_of


def data(count: int = 3000) -> Dataset:
    """Ego "weak" fails where the first number is above a half, ego "sound" never."""
    random = np.random.default_rng(0)
    points = random.random((count, inputs_of("low"))).astype(np.float32)
    egos = np.array(["weak", "sound"])[random.integers(2, size=count)]
    failed = (points[:, 0] > 0.5) & (egos == "weak")
    kinds = np.where(failed, np.where(points[:, 1] > 0.5, "a", "b"), "")
    heads = np.stack([failed, failed, failed & (points[:, 1] > 0.5)], 1).astype(np.float32)
    return Dataset(points, heads, kinds, egos)


def test_a_model_learns_which_points_fail_which_ego(monkeypatch):
    monkeypatch.setattr(fitting, "EPOCHS", 8)
    prior = fitted_prior("low", data(), seed=0)
    assert prior.model.egos == ("sound", "weak")
    assert prior.card["auc_fails"] > 0.97
    assert prior.card["auc_fails_unknown"] < prior.card["auc_fails"]
    assert set(prior.library_kinds) == {"a", "b"}
    assert (prior.library[:, 0] > 0.5).all()


def test_beliefs_are_distributions_under_which_the_ego_is_likely():
    import torch

    drawn = beliefs(torch.full((2000,), 3), 8)
    torch.testing.assert_close(drawn.sum(1), torch.ones(2000), atol=1e-5, rtol=0)
    assert drawn[:, 3].mean() > 0.55 > 0.1 > drawn[:, 0].mean()


def test_auc_is_one_for_a_perfect_order_and_a_half_for_none():
    positive = np.array([False, False, True, True])
    assert auc(np.array([0.1, 0.2, 0.3, 0.4], np.float32), positive) == 1.0
    assert auc(np.zeros(4, np.float32), positive) == 0.5


@pytest.mark.parametrize("family", ["low", "mixed", "dense"])
def test_every_training_ego_can_be_run(family):
    for ego in training_egos(family).values():
        Problem.from_spec(RunSpec(family=family, method="archive", seed=0, ego=ego))
