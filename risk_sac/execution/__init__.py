"""Executes runs and writes them down: one in this process, or a campaign's in processes of their own."""
