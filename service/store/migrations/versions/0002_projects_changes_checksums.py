"""Projects, idempotency keys, revisions, changes of state, usage, attempts, checksums."""

import json

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Gives what is there the project `default`; it stays without checksums, since nobody vouches for it."""
    op.add_column("campaigns", sa.Column("project", sa.String, nullable=False, server_default="default"))
    op.add_column("campaigns", sa.Column("label", sa.String, nullable=False, server_default=""))
    op.add_column("campaigns", sa.Column("idempotency_key", sa.String))
    op.add_column("campaigns", sa.Column("revision", sa.Integer, nullable=False, server_default="1"))
    op.add_column("runs", sa.Column("attempts", sa.Integer, nullable=False, server_default="0"))
    op.add_column("episodes", sa.Column("series_sha256", sa.String))
    for table in ("campaigns", "runs", "episodes"):
        op.add_column(table, sa.Column("checksum", sa.BigInteger))
    _fill_labels()
    op.create_index("campaigns_idempotency", "campaigns", ["project", "idempotency_key"], unique=True)
    op.create_index("campaigns_state", "campaigns", ["state", "number"])
    op.create_index("campaigns_label", "campaigns", ["label", "number"])
    op.create_index("campaigns_project", "campaigns", ["project", "number"])
    op.create_index("runs_ids", "runs", ["campaign_number", "id"], unique=True)
    op.create_index("runs_families", "runs", ["family", "campaign_number"])
    op.create_index("runs_methods", "runs", ["method", "campaign_number"])
    op.create_index("runs_tallies", "runs", ["family", "method", "state", "episodes_done", "failures"])
    op.create_index("episodes_runs", "episodes", ["run_number", "number"])
    op.create_index("episodes_ids", "episodes", ["run_number", "phase", "index"], unique=True)
    op.create_table(
        "changes",
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("campaign_number", sa.Integer, sa.ForeignKey("campaigns.number"), nullable=False),
        sa.Column("run_id", sa.String),
        sa.Column("state", sa.String, nullable=False),
        sa.Column("reason", sa.String),
        sa.Column("at", sa.Float, nullable=False),
        sa.Column("checksum", sa.BigInteger),
        sqlite_autoincrement=True,
    )
    op.create_index("changes_pages", "changes", ["campaign_number", "number"])
    op.create_table(
        "usage",
        sa.Column("project", sa.String, primary_key=True),
        sa.Column("hour", sa.Integer, primary_key=True, autoincrement=False),
        sa.Column("busy_s", sa.Float, nullable=False),
        sa.Column("checksum", sa.BigInteger),
    )


def _fill_labels() -> None:
    campaigns = sa.table("campaigns", sa.column("number"), sa.column("spec"), sa.column("label"))
    bind = op.get_bind()
    for number, spec in bind.execute(sa.select(campaigns.c.number, campaigns.c.spec)).all():
        label = json.loads(spec).get("label", "")
        bind.execute(sa.update(campaigns).where(campaigns.c.number == number).values(label=label))
