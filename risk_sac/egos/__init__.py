"""Egos that drive themselves: the seam, those that are shipped, and processes that speak to us."""

from risk_sac.egos.seam import Command, Control, Ego, Episode, Perceived, Trajectory, Vehicle

__all__ = ["Command", "Control", "Ego", "Episode", "Perceived", "Trajectory", "Vehicle"]
