"""Campaigns may have a message that is sent when they end."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Adds the table."""
    op.create_table(
        "notices",
        sa.Column("campaign_number", sa.Integer(), sa.ForeignKey("campaigns.number"), primary_key=True),
        sa.Column("url", sa.String(), nullable=False),
        sa.Column("link", sa.String(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("tries", sa.Integer(), nullable=False),
        sa.Column("due_at", sa.Float(), nullable=False),
        sa.Column("reason", sa.Text(), nullable=True),
    )
    op.create_index("notices_state", "notices", ["state", "due_at"])
