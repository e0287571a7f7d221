"""Renames the phases of a run: `train` to `search`, `evaluate` to `evaluation`."""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"

NAMES = {"train": "search", "evaluate": "evaluation"}


def upgrade() -> None:
    """Renames in rows and records."""
    _rename(NAMES)


def downgrade() -> None:
    """Goes back to the names of before."""
    _rename({new: old for old, new in NAMES.items()})


def _rename(names: dict[str, str]) -> None:
    update = "UPDATE episodes SET phase = :new, record = replace(record, :old_field, :new_field) WHERE phase = :old"
    for old, new in names.items():
        fields = {"old_field": f'"phase":"{old}"', "new_field": f'"phase":"{new}"'}
        op.execute(sa.text(update).bindparams(old=old, new=new, **fields))
