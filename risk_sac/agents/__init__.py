"""Soft actor-critic under a realism constraint, with risk-guided replay. Start at `learner`."""
