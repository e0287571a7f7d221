"""SUMO behind a small seam: simulation, adversary control, the ego's perception, the collision oracle."""
