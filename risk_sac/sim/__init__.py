"""SUMO behind a small interface: simulation, adversary control, perception, collision oracle."""
