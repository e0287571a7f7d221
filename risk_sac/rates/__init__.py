"""Failure rates under a declared distribution, by fewer episodes than plain draws."""
