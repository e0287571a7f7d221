"""Runs on a Ray cluster, see README.md. No other package imports Ray."""
