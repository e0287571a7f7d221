"""Replays, minimises, studies, draws and exports failures."""
