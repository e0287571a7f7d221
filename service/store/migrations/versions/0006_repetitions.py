"""Which of a run's distinct failures repeat."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    """Nothing of what is there was replayed."""
    op.add_column("runs", sa.Column("repetitions", sa.Text))
