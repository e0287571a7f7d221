"""Egos that drive themselves: the seam, shipped ones and remote processes."""

from risk_sac.egos.seam import Command, Control, Ego, EpisodeStart, Perceived, Trajectory, Vehicle
from risk_sac.world.types import Lane, Road, StopLine

__all__ = [
    "Command",
    "Control",
    "Ego",
    "EpisodeStart",
    "Lane",
    "Perceived",
    "Road",
    "StopLine",
    "Trajectory",
    "Vehicle",
]
