"""Egos with known faults: a catalogue of defects, and the decorators that plant them into an ego."""
