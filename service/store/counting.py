"""What an episode adds to its row, its run's counts and its project's hours."""

import time

from pydantic_core import from_json
from sqlalchemy.orm import Session

from risk_sac.execution.messages import EpisodeDone
from risk_sac.records import EpisodeRecord, Funnel, Outcome, stored
from service.store.tables import EpisodeRow, RunRow, UsageRow

HOUR_S = 3600


def add_usage(session: Session, project: str, busy_s: float) -> None:
    """Adds worker time to what a project has used in the present hour."""
    hour = int(time.time() // HOUR_S)
    row = session.get(UsageRow, (project, hour))
    if row is None:
        session.add(UsageRow(project=project, hour=hour, busy_s=busy_s))
    else:
        row.busy_s += busy_s


def count(run: RunRow, outcome: Outcome, sign: int) -> None:
    """Adds an episode with this outcome to a run's counts (+1), or takes it out (-1)."""
    run.episodes_done += sign
    run.rejected += sign * (outcome is Outcome.REJECTED)
    run.raw_collisions += sign * (outcome in (Outcome.FAILURE, Outcome.DEGENERATE))
    run.failures += sign * (outcome is Outcome.FAILURE)


def tally(run: RunRow) -> None:
    """Copies order-dependent counts from the run's metrics."""
    phases = [from_json(text) for text in (run.metrics, run.evaluation) if text is not None]
    for name in ("distinct_failures", "preventable", "distinct_preventable"):
        setattr(run, name, sum(phase.get(name, 0) for phase in phases))


def fill(row: EpisodeRow, event: EpisodeDone) -> None:
    """Fills an episode's row from a worker's message."""
    fill_record(row, event.record)
    row.series = event.series
    row.series_sha256 = event.series_sha256
    row.wall_s = event.wall_s
    row.funnel = stored(Funnel.of(event.metrics))


def fill_record(row: EpisodeRow, record: EpisodeRecord) -> None:
    """Writes an episode's record into its row, and the columns that are searched."""
    row.phase = record.phase
    row.index = record.index
    row.outcome = record.outcome
    row.record = stored(record)
    judgement = record.collision.judgement if record.collision is not None else None
    row.grade = judgement.grade if judgement is not None and record.outcome is Outcome.FAILURE else None
    row.signature = judgement.signature if judgement is not None else None
    row.broke = f",{','.join(judgement.broke)}," if judgement is not None else None
