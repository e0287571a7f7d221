"""Second step: failures have the weight by which they are ranked."""

import sqlalchemy as sa
from alembic import op

from risk_sac.records import EpisodeRecord, Outcome
from risk_sac.scenario.families import density_of

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Adds the column, and fills it from the records of failures."""
    op.add_column("episodes", sa.Column("weight", sa.Float()))
    connection = op.get_bind()
    failures = sa.text(
        "SELECT e.number, e.record, r.family FROM episodes e JOIN runs r ON r.number = e.run_number "
        "WHERE e.outcome = :outcome"
    )
    changed = sa.text("UPDATE episodes SET weight = :weight WHERE number = :number")
    for number, record, family in connection.execute(failures, {"outcome": Outcome.FAILURE}).all():
        try:
            episode = EpisodeRecord.model_validate_json(record)
        except ValueError:  # a damaged row, which its readers name
            continue
        worst = episode.worst_violation
        weight = 0.0 if worst is None else worst.weight(density_of(family)(episode.scene))
        connection.execute(changed, {"weight": weight, "number": number})
