"""The funnel of runs and episodes, grades, signatures, what strikers broke."""

import json

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"

TALLIED = ("episodes_done", "raw_collisions", "failures", "distinct_failures", "preventable", "distinct_preventable")


def upgrade() -> None:
    """Counts the distinct failures of what is there; nobody judged them, so none of them is preventable."""
    for name in ("distinct_failures", "preventable", "distinct_preventable"):
        op.add_column("runs", sa.Column(name, sa.Integer, nullable=False, server_default="0"))
    for name in ("grade", "signature", "broke"):
        op.add_column("episodes", sa.Column(name, sa.String))
    op.add_column("episodes", sa.Column("funnel", sa.Text))
    for name in ("grade", "signature"):
        judged = sa.text(f"{name} IS NOT NULL")
        columns = ["campaign_number", name, "number"]
        op.create_index(f"episodes_{name}s", "episodes", columns, sqlite_where=judged, postgresql_where=judged)
    op.drop_index("runs_tallies", "runs")
    op.create_index("runs_tallies", "runs", ["family", "method", "state", *TALLIED])
    _count_distinct()


def _count_distinct() -> None:
    runs = sa.table("runs", *map(sa.column, ("number", "metrics", "evaluation", "distinct_failures")))
    bind = op.get_bind()
    for run in bind.execute(sa.select(runs).where(runs.c.metrics.is_not(None))).mappings().all():
        phases = [json.loads(text) for text in (run["metrics"], run["evaluation"]) if text is not None]
        distinct = sum(phase.get("distinct_failures", 0) for phase in phases)
        bind.execute(sa.update(runs).where(runs.c.number == run["number"]).values(distinct_failures=distinct))
