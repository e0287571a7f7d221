"""Runs as tasks of a Ray cluster; README.md says how. Nothing outside this room imports Ray or needs it."""
