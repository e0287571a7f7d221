"""First step: a new database is made from the current tables."""

revision = "0001"
down_revision = None


def upgrade() -> None:
    """Does nothing: `service.store.database` makes the tables."""
