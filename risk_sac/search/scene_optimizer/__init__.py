"""Searches initial scenes in the unit cube by ask and tell.

Source: RISK-SAC, Eq. 11 and Alg. 1, l. 1, 4, 21-22.
"""

from risk_sac.search.scene_optimizer.archive import ArchiveOptimizer, DiscountedBandit
from risk_sac.search.scene_optimizer.base import IidSampler, SceneOptimizer, SobolOptimizer
from risk_sac.search.scene_optimizer.bayesian import BotorchOptimizer
from risk_sac.search.scene_optimizer.boundary import BoundarySampler
from risk_sac.search.scene_optimizer.grid import GridSampler
from risk_sac.search.scene_optimizer.rate import RateSampler
from risk_sac.search.scene_optimizer.registered import RegisteredSampler
