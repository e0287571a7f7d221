"""Exports a failure, or all episodes of runs, to other tools' formats.

There is one module a format, and one table of them.
"""
