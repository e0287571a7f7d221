import pytest
import torch

from risk_sac.agents.ddpg import deterministic_target


def test_deterministic_target_of_a_hand_computed_case() -> None:
    target = deterministic_target(torch.tensor([1.0, 1.0]), torch.tensor([0.0, 1.0]), torch.tensor([3.0, 3.0]), 0.9)
    assert target.tolist() == pytest.approx([1.0 + 0.9 * 3.0, 1.0])
