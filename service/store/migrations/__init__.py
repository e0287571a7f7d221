"""How the database came to look as `service.store.tables` says; each version is a step from the one before."""
