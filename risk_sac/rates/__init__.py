"""Failure rates under a declared distribution, from fewer episodes than plain draws take."""
