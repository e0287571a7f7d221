"""The egos that the prior is trained on. Planners and the catalogue's test set are not among them.

Choice: weak ones are among them, since they give the first failures, and what is learnt on them carries over.
"""

from collections.abc import Mapping

import numpy as np

from risk_sac.config import EgoConfig
from risk_sac.egos.defects.catalogue import DEFECTS

SOUND: dict[str, EgoConfig] = {
    "default": EgoConfig(),
    "slow": EgoConfig(reaction_time_s=1.0),
    "fast": EgoConfig(reaction_time_s=0.1),
    "careful": EgoConfig(profile="careful"),
    "defensive": EgoConfig(profile="defensive"),
    "idm-aeb": EgoConfig(driver="idm-aeb"),
    "r157": EgoConfig(driver="r157"),
    "rss": EgoConfig(driver="rss"),
}

HELD_OUT = ("r157", "latency", "late-tracks", "tailgates")
"""Egos that policies are not trained on, so that their curves can be drawn on egos never met."""


def training_egos(family: str) -> dict[str, EgoConfig]:
    """Returns the egos of a shipped family by name: the sound ones, and those with a defect of the training part."""
    faulty = {
        name: EgoConfig(driver="idm-aeb", defects=(name,))
        for name, defect in DEFECTS.items()
        if not defect.test_set and defect.kind != "sumo" and family in defect.families
    }
    return SOUND | faulty


def drawn_ego(egos: Mapping[str, EgoConfig], random: np.random.Generator, sound: float) -> str:
    """Draws an ego's name; a share of the draws, `sound`, has no defect."""
    faulty = [name for name, ego in egos.items() if ego.defects]
    others = [name for name, ego in egos.items() if not ego.defects]
    names = others if random.random() < sound else faulty
    return names[random.integers(len(names))]
