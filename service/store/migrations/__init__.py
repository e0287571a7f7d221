"""Migrations to the schema of `service.store.tables`; each version is one step."""
