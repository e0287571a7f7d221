"""Measures of risk and realism, and the requirements they are judged by; one family of pure functions a module."""
