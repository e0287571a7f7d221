"""Campaigns have tags."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    """Adds the column, empty in the rows that are there."""
    op.add_column("campaigns", sa.Column("tags", sa.String(), nullable=True))
