"""Adds severity, fault and headline failures; renames grades and reference drivers."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"

GRADES = {"careful": "preventable", "ideal": "full_braking"}
TALLIED = ("episodes_done", "raw_collisions", "failures", "distinct_failures", "preventable", "distinct_preventable")
COUNTS = ("headline_candidates", "headline")
DRIVERS = {"careful": "r157", "ideal": "full_braking"}
NAMES = {f'"grade":"{old}"': f'"grade":"{new}"' for old, new in GRADES.items()} | {
    f'"{old}":{value}': f'"{new}":{value}' for old, new in DRIVERS.items() for value in ("{", "true", "false")
}


def upgrade() -> None:
    """Adds the columns, and renames in rows and records."""
    for name in ("severity", "fault"):
        op.add_column("episodes", sa.Column(name, sa.String))
    op.add_column("runs", sa.Column("headline_candidates", sa.Integer, nullable=False, server_default="0"))
    op.add_column("runs", sa.Column("headline", sa.Integer))
    _index_tallies(*TALLIED, *COUNTS)
    for severity in ("minor", "moderate", "severe"):
        update = "UPDATE episodes SET severity = :severity WHERE outcome = 'failure' AND record LIKE :written"
        op.execute(sa.text(update).bindparams(severity=severity, written=f'%"severity":"{severity}"%'))
    _rename(GRADES, NAMES)


def downgrade() -> None:
    """Drops them, and goes back to the names of before."""
    _index_tallies(*TALLIED)
    for name in COUNTS:
        op.drop_column("runs", name)
    _rename(*({new: old for old, new in names.items()} for names in (GRADES, NAMES)))
    for name in ("fault", "severity"):
        op.drop_column("episodes", name)


def _index_tallies(*names: str) -> None:
    op.drop_index("runs_tallies", "runs")
    op.create_index("runs_tallies", "runs", ["family", "method", "state", *names])


def _rename(grades: dict[str, str], names: dict[str, str]) -> None:
    for old, new in grades.items():
        op.execute(sa.text("UPDATE episodes SET grade = :new WHERE grade = :old").bindparams(old=old, new=new))
    for old, new in names.items():
        update = sa.text("UPDATE episodes SET record = replace(record, :old, :new) WHERE violated IS NOT NULL")
        op.execute(update.bindparams(old=old, new=new))
