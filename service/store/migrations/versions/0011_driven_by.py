"""Adds what drove an episode's adversaries and the pace of runs; unknown for older ones."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"

KINDS = ("policy", "model", "script", "random")


def upgrade() -> None:
    """Adds the columns, and fills the first from records that were stored before a step back."""
    op.add_column("runs", sa.Column("pace_s", sa.Double))
    op.add_column("episodes", sa.Column("driven_by", sa.String))
    written = {kind: f'%"driven_by":"{kind}"%' for kind in KINDS}
    cases = " ".join(f"WHEN record LIKE :{kind} THEN '{kind}'" for kind in KINDS)
    update = sa.text(f"UPDATE episodes SET driven_by = CASE {cases} END WHERE record LIKE :known")
    op.execute(update.bindparams(known='%"driven_by":"%', **written))


def downgrade() -> None:
    """Drops them; the records keep what drove the adversaries."""
    op.drop_column("runs", "pace_s")
    op.drop_column("episodes", "driven_by")
