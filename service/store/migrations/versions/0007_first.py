"""Oldest step that this version reads; a new database is made from the current tables."""

revision = "0007"
down_revision = None


def upgrade() -> None:
    """Does nothing: only a database at this step begins here."""
