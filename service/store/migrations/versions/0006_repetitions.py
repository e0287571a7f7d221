"""Which of a run's distinct failures repeat."""

import zlib

import sqlalchemy as sa
from alembic import op
from pydantic_core import to_json

revision = "0006"
down_revision = "0005"

# What the checksum of a run was formed over; over `TALLIED` where one of them is not 0, or there are repetitions.
SUMMED = (
    *("campaign_number", "id", "family", "method", "seed", "spec_digest", "state", "reason", "started_at"),
    *("finished_at", "episodes_total", "episodes_done", "rejected", "raw_collisions", "failures", "busy_s"),
    *("attempts", "metrics", "evaluation", "digest", "versions"),
)
TALLIED = ("distinct_failures", "preventable", "distinct_preventable")
runs = sa.table("runs", *map(sa.column, ("number", "checksum", "repetitions", *SUMMED, *TALLIED)))


def upgrade() -> None:
    """Nothing of what is there was replayed."""
    op.add_column("runs", sa.Column("repetitions", sa.Text))


def downgrade() -> None:
    """Forgets the repetitions; a run that is damaged keeps the checksum that shows it."""
    bind = op.get_bind()
    for run in bind.execute(sa.select(runs).where(runs.c.repetitions.is_not(None))).mappings().all():
        values, added = tuple(run[name] for name in SUMMED), tuple(run[name] for name in TALLIED)
        if run["checksum"] == _checksum((*values, *added, run["repetitions"])):
            older = _checksum((*values, *added) if any(added) else values)
            bind.execute(sa.update(runs).where(runs.c.number == run["number"]).values(checksum=older))
    op.drop_column("runs", "repetitions")


def _checksum(values: tuple[object, ...]) -> int:
    return zlib.crc32(to_json(values, inf_nan_mode="strings"))
