"""The closed loop as a Gymnasium environment, and the problem that it poses."""
