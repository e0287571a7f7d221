"""Campaigns at work: the queue, quotas, pauses and what is deleted."""
