"""API keys: authentication, projects, scopes and rate limits."""
