"""Ask / tell search over initial scenes in the unit cube, Eq. 11 and Alg. 1, l. 1, 4, 21-22."""

from risk_sac.scene_optimizer.archive import ArchiveOptimizer
from risk_sac.scene_optimizer.bandit import DiscountedBandit
from risk_sac.scene_optimizer.base import NOBODY, Encounter, SceneOptimizer, State
from risk_sac.scene_optimizer.bayesian import BotorchOptimizer
from risk_sac.scene_optimizer.iid import IidSampler
from risk_sac.scene_optimizer.objective import RunningMaximum, objective, update_running_maximum
from risk_sac.scene_optimizer.sobol import SobolOptimizer

__all__ = [
    "NOBODY",
    "ArchiveOptimizer",
    "BotorchOptimizer",
    "DiscountedBandit",
    "Encounter",
    "IidSampler",
    "RunningMaximum",
    "SceneOptimizer",
    "SobolOptimizer",
    "State",
    "objective",
    "update_running_maximum",
]
