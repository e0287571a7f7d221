"""Learners: soft actor-critic, replay, dual variable, and controls without learning."""
