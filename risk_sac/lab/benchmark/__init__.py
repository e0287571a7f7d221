"""Measures how soon search methods detect egos with known faults."""
