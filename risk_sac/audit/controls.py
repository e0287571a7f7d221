"""What is tried: an ego, and what its adversaries do."""

from dataclasses import dataclass
from typing import Literal

from risk_sac.config import EgoConfig

Attack = Literal["nobody", "idle", "random"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """One row of the audit."""

    name: str
    attack: Attack  # nobody: SUMO drives all and pedestrians stand; idle: all actions 0; random: as the method `random`
    ego: EgoConfig


# From the slowest driver to the best, and beside them two that share the default's reaction time: one that sees all,
# and one with the careful driver's braking on top.
LADDER = (
    Control(name="reaction 1.0 s", attack="random", ego=EgoConfig(reaction_time_s=1.0)),
    Control(name="reaction 0.5 s", attack="random", ego=EgoConfig()),
    Control(name="reaction 0.1 s", attack="random", ego=EgoConfig(reaction_time_s=0.1)),
    Control(name="reaction 0.1 s, sees all", attack="random", ego=EgoConfig(profile="perfect")),
    Control(name="reaction 0.5 s, sees all", attack="random", ego=EgoConfig(sensor=None)),
    Control(name="careful", attack="random", ego=EgoConfig(profile="careful")),
)
NOBODY = Control(name="nobody attacks", attack="nobody", ego=EgoConfig())
IDLE = Control(name="all actions 0", attack="idle", ego=EgoConfig())
CONTROLS = (NOBODY, IDLE, *LADDER)
