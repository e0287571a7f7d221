"""The funnel of runs and episodes, grades, signatures, what strikers broke."""

import json
import zlib

import sqlalchemy as sa
from alembic import op
from pydantic_core import to_json

revision = "0003"
down_revision = "0002"

# What the checksum of a run was formed over.
SUMMED = (
    *("campaign_number", "id", "family", "method", "seed", "spec_digest", "state", "reason", "started_at"),
    *("finished_at", "episodes_total", "episodes_done", "rejected", "raw_collisions", "failures", "busy_s"),
    *("attempts", "metrics", "evaluation", "digest", "versions"),
)
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
    """A run keeps its checksum, unless it has distinct failures; one that is damaged is left alone, and so stays so."""
    runs = sa.table("runs", *map(sa.column, ("number", "checksum", "distinct_failures", *SUMMED)))
    bind = op.get_bind()
    for run in bind.execute(sa.select(runs).where(runs.c.metrics.is_not(None))).mappings().all():
        values = tuple(run[name] for name in SUMMED)
        if run["checksum"] not in (None, _checksum(values)):
            continue
        phases = [json.loads(text) for text in (run["metrics"], run["evaluation"]) if text is not None]
        distinct = sum(phase.get("distinct_failures", 0) for phase in phases)
        if distinct:
            checksum = None if run["checksum"] is None else _checksum((*values, distinct, 0, 0))
            changed = sa.update(runs).where(runs.c.number == run["number"])
            bind.execute(changed.values(distinct_failures=distinct, checksum=checksum))


def _checksum(values: tuple[object, ...]) -> int:
    return zlib.crc32(to_json(values, inf_nan_mode="strings"))
