import numpy as np
import pytest

from risk_sac.config import RunSpec
from risk_sac.env.problem import Problem
from risk_sac.lab.pretraining import fit as fitting
from risk_sac.lab.pretraining.episodes import training_egos
from risk_sac.lab.pretraining.fit import Dataset, auc, beliefs, fit, held_out_documents, library_of
from risk_sac.scenario.reading import PAPER_FAMILIES
from risk_sac.search.prior.shipped import inputs_of
from risk_sac.search.prior.tokens import Tokenizer
from risk_sac.search.scripts import SIZE, Genes

CUE, DRIVE = Genes._fields.index("cue"), Genes._fields.index("drive")


def data(count: int = 1500) -> Dataset:
    """Ego "weak" fails where the leader strikes late, ego "sound" never."""
    random = np.random.default_rng(0)
    problem = Problem.from_spec(RunSpec(family="low", method="archive", seed=0))
    size, lead = problem.space.dimension, problem.space.dimension + SIZE * problem.family.adversaries.index("lead")
    points = np.concatenate([np.repeat(random.random((20, size)), count // 20, 0), random.random((count, 24))], axis=1)
    points[:, lead] = 0.9  # it acts
    egos = np.array(["weak", "sound"])[random.integers(2, size=count)]
    failed = (points[:, lead + CUE] > 0.5) & (egos == "weak")
    kinds = np.where(failed, np.where(points[:, lead + DRIVE] > 0.5, "a", "b"), "")
    heads = np.stack([failed, failed, failed & (kinds == "a")], 1).astype(np.float32)
    return Dataset(list(points), Tokenizer(problem).batch(points), heads, kinds, egos, np.full(count, "low"))


def test_a_model_learns_which_scripts_fail_which_ego(monkeypatch):
    monkeypatch.setattr(fitting, "EPOCHS", 12)
    episodes = data()
    model, card = fit(episodes, seed=0)
    assert model.egos == ("sound", "weak")
    scores = card["area_under_curve"]["held-out episodes"]
    assert scores["fails, ego known"] > 0.95
    assert scores["fails, ego unknown"] < scores["fails, ego known"]
    library = library_of(episodes, model, "low")
    assert library.points.shape == (len(library.kinds), inputs_of("low"))
    assert set(library.kinds) == {"a", "b"}


def test_every_third_document_is_held_out_and_no_family_of_the_paper():
    assert held_out_documents()[:2] == ("cyclist_behind_van", "left_turn_motorcycle")
    assert not set(held_out_documents()) & set(PAPER_FAMILIES)


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
