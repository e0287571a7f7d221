"""Road nets of the scenario families, as package data."""
