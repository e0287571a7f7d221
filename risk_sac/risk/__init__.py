"""Measures risk and realism, and monitors requirements.

There is one family of pure functions a module.
"""
