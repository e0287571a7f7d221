"""Measures of risk and realism, and the requirements they are judged by; each module is one family of pure functions."""
