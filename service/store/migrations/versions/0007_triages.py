"""What people made of failures."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    """Nobody has looked at any of those that are there."""
    op.create_table(
        "triages",
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("campaign_number", sa.Integer, sa.ForeignKey("campaigns.number"), nullable=False),
        sa.Column("episode_number", sa.Integer, sa.ForeignKey("episodes.number"), nullable=False),
        sa.Column("state", sa.String, nullable=False),
        sa.Column("comment", sa.Text, nullable=False),
        sa.Column("changed_at", sa.Float, nullable=False),
        sa.Column("checksum", sa.BigInteger),
        sqlite_autoincrement=True,
    )
    op.create_index("triages_episodes", "triages", ["campaign_number", "episode_number"], unique=True)
