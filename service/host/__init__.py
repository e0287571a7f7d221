"""The server process itself: its logs, locks, event loop and settings."""
