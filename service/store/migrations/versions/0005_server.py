"""What the server itself has to remember: the secret of its cursors, and whether an API key was ever made."""

import secrets

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    """Creates the one row there is. Keys that there are already, the next server notes when it sees their file."""
    server = op.create_table(
        "server",
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("cursor_secret", sa.String, nullable=False),
        sa.Column("keys_made_at", sa.Float),
        sa.Column("checksum", sa.BigInteger),
    )
    op.bulk_insert(server, [{"number": 1, "cursor_secret": secrets.token_bytes(32).hex(), "keys_made_at": None}])
