"""The oldest step that this version reads; a new database is made from the tables as they are now."""

revision = "0007"
down_revision = None


def upgrade() -> None:
    """Does nothing: only a database that is already at this step begins here."""
