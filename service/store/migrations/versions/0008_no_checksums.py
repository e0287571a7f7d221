"""Rows without checksums: SQLite's own integrity check replaces them."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"

TABLES = ("campaigns", "runs", "episodes", "changes", "usage", "server", "triages")


def upgrade() -> None:
    """Drops the column."""
    for table in TABLES:
        op.drop_column(table, "checksum")


def downgrade() -> None:
    """Adds it without values, as in rows older than checksums."""
    for table in TABLES:
        op.add_column(table, sa.Column("checksum", sa.BigInteger))
