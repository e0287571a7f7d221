"""How the database came to look as `service.tables` says; each version is a step from the one before."""
