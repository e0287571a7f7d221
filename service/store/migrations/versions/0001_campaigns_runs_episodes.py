"""Campaigns, their runs, the runs' episodes."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None


def upgrade() -> None:
    """Creates the tables, unless a server from before there were versions has."""
    if sa.inspect(op.get_bind()).has_table("campaigns"):
        return
    op.create_table(
        "campaigns",
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("id", sa.String, nullable=False, unique=True),
        sa.Column("spec", sa.Text, nullable=False),
        sa.Column("state", sa.String, nullable=False),
        sa.Column("reason", sa.String),
        sa.Column("created_at", sa.Float, nullable=False),
        sa.Column("started_at", sa.Float),
        sa.Column("finished_at", sa.Float),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "runs",
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("campaign_number", sa.Integer, sa.ForeignKey("campaigns.number"), nullable=False),
        sa.Column("id", sa.String, nullable=False),
        sa.Column("family", sa.String, nullable=False),
        sa.Column("method", sa.String, nullable=False),
        sa.Column("seed", sa.Integer, nullable=False),
        sa.Column("spec_digest", sa.String, nullable=False),
        sa.Column("state", sa.String, nullable=False),
        sa.Column("reason", sa.String),
        sa.Column("started_at", sa.Float),
        sa.Column("finished_at", sa.Float),
        sa.Column("episodes_total", sa.Integer, nullable=False),
        sa.Column("episodes_done", sa.Integer, nullable=False),
        sa.Column("rejected", sa.Integer, nullable=False),
        sa.Column("raw_collisions", sa.Integer, nullable=False),
        sa.Column("failures", sa.Integer, nullable=False),
        sa.Column("busy_s", sa.Float, nullable=False),
        sa.Column("metrics", sa.Text),
        sa.Column("evaluation", sa.Text),
        sa.Column("digest", sa.String),
        sa.Column("versions", sa.Text, nullable=False),
        sqlite_autoincrement=True,
    )
    op.create_index("runs_queue", "runs", ["state", "number"])
    op.create_table(
        "episodes",
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("campaign_number", sa.Integer, sa.ForeignKey("campaigns.number"), nullable=False),
        sa.Column("run_number", sa.Integer, sa.ForeignKey("runs.number"), nullable=False),
        sa.Column("phase", sa.String, nullable=False),
        sa.Column("index", sa.Integer, nullable=False),
        sa.Column("outcome", sa.String, nullable=False),
        sa.Column("record", sa.Text, nullable=False),
        sa.Column("series", sa.String),
        sa.Column("wall_s", sa.Float, nullable=False),
        sqlite_autoincrement=True,
    )
    op.create_index("episodes_pages", "episodes", ["campaign_number", "number"])
    op.create_index("episodes_outcomes", "episodes", ["campaign_number", "outcome", "number"])
