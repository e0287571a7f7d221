"""API keys: who may call the service, for which project, and how much."""
