"""Egos for tests: one drives well, others leave lane, road or rules.

Put the folder above on `PYTHONPATH`: the `dist-info` beside this package registers its egos.
"""
