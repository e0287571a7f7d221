"""Egos for tests: one that drives well, and some that leave their lane, their road or the rules.

Put the folder above on `PYTHONPATH`: the `dist-info` beside this package registers its egos.
"""
