"""Runs state by how many processes their episodes are played."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Adds the column, empty in the rows that are there."""
    op.add_column("runs", sa.Column("processes", sa.Integer(), nullable=True))
