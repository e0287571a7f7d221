"""Gymnasium environment of the closed loop, and the problem that it poses."""
