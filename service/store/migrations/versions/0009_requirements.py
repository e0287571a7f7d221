"""Requirements of episodes and runs; a failure of before was a contact."""

import sqlalchemy as sa
from alembic import op

from service.errors import StorageError

revision = "0009"
down_revision = "0008"

STEPS = ("violated", "valid", "distinct", "preventable")


def upgrade() -> None:
    """Adds the columns and the table."""
    for name in ("violated", "failed"):
        op.add_column("episodes", sa.Column(name, sa.String))
    op.execute("UPDATE episodes SET violated = ',no_contact,' WHERE outcome IN ('failure', 'degenerate')")
    op.execute("UPDATE episodes SET failed = ',no_contact,' WHERE outcome = 'failure'")
    op.create_table(
        "requirements",
        sa.Column("run_number", sa.Integer, sa.ForeignKey("runs.number"), primary_key=True),
        sa.Column("name", sa.String, primary_key=True),
        *(sa.Column(step, sa.Integer, nullable=False) for step in STEPS),
    )
    op.create_index("requirements_tallies", "requirements", ["name", *STEPS])


def downgrade() -> None:
    """Drops them; StorageError if a failure has no contact, unknown to the version before."""
    without = "FROM episodes WHERE outcome IN ('failure', 'degenerate') AND violated NOT LIKE '%,no_contact,%'"
    campaigns = f"SELECT DISTINCT id FROM campaigns WHERE number IN (SELECT campaign_number {without})"
    if ids := list(op.get_bind().scalars(sa.text(campaigns))):
        kept = f"failures without contact, which the version before cannot read, are in the campaigns {', '.join(ids)}"
        raise StorageError(f"{kept}; delete these, or start the version before on a copy from before the update")
    op.drop_table("requirements")
    for name in ("failed", "violated"):
        op.drop_column("episodes", name)
