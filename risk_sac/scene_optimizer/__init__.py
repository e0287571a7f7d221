"""Searches initial scenes in the unit cube by ask and tell.

Source: RISK-SAC, Eq. 11 and Alg. 1, l. 1, 4, 21-22.
"""

from risk_sac.scene_optimizer.archive import ArchiveOptimizer
from risk_sac.scene_optimizer.bandit import DiscountedBandit
from risk_sac.scene_optimizer.base import NO_ENCOUNTER, Encounter, SceneOptimizer
from risk_sac.scene_optimizer.bayesian import BotorchOptimizer
from risk_sac.scene_optimizer.samplers import IidSampler, SobolOptimizer
