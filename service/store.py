"""Reading the database. Nothing here writes: that is the manager's alone, in `service.ledger`."""

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from sqlite3 import Connection

from pydantic import TypeAdapter
from sqlalchemy import Engine, Select, create_engine, event, select
from sqlalchemy.exc import DatabaseError, IntegrityError, ProgrammingError
from sqlalchemy.orm import Session, selectinload

from risk_sac.config import CampaignSpec
from risk_sac.types import EpisodeRecord, Outcome, RunMetrics
from service.campaigns import State
from service.errors import NotFoundError, StorageError
from service.records import Campaign, Episode, Page, Run
from service.tables import Base, CampaignRow, EpisodeRow, RunRow

_METRICS: TypeAdapter[RunMetrics] = TypeAdapter(RunMetrics)
_RECORD: TypeAdapter[EpisodeRecord] = TypeAdapter(EpisodeRecord)
_VERSIONS: TypeAdapter[dict[str, str]] = TypeAdapter(dict[str, str])


class Store:
    """Snapshots of campaigns, runs and episodes.

    Attributes:
      unsaved: reasons of campaigns whose failure could not be written, by id. The disk that fails a
        campaign also refuses the note about it, and readers must still be told.
    """

    def __init__(self, database: Path) -> None:
        """Open the database, creating it where there is none.

        Raises:
          StorageError: the file cannot be opened or is no database.
        """
        self.engine = _engine(database)
        self.unsaved: dict[str, str] = {}
        with storage_errors("opening the database"):
            Base.metadata.create_all(self.engine)

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()

    def campaign(self, campaign_id: str) -> Campaign:
        """The campaign with this id.

        Raises:
          NotFoundError: there is none.
        """
        with self._reading() as session:
            return self._campaign(find_campaign(session, campaign_id))

    def campaigns(self, limit: int, before: int | None = None) -> Page[Campaign]:
        """Newest first, from the campaign just older than number `before`."""
        query = select(CampaignRow).options(selectinload(CampaignRow.runs)).order_by(CampaignRow.number.desc())
        if before is not None:
            query = query.where(CampaignRow.number < before)
        with self._reading() as session:
            rows = list(session.scalars(query.limit(limit + 1)))
            last = rows[limit - 1].number if len(rows) > limit else None
            return Page(items=tuple(self._campaign(row) for row in rows[:limit]), last=last)

    def episodes(
        self,
        campaign_id: str,
        *,
        limit: int,
        after: int | None = None,
        run_id: str | None = None,
        outcomes: Collection[Outcome] = (),
    ) -> Page[Episode]:
        """In order of arrival, from the episode just after number `after`; no outcomes means all.

        Raises:
          NotFoundError: there is no such campaign, or it has no such run.
        """
        with self._reading() as session:
            campaign = find_campaign(session, campaign_id)
            query = select(EpisodeRow).where(EpisodeRow.campaign_number == campaign.number)
            if run_id is not None:
                query = query.where(EpisodeRow.run_number == _find_run(campaign, run_id).number)
            if outcomes:
                query = query.where(EpisodeRow.outcome.in_([outcome.value for outcome in outcomes]))
            return _episode_page(session, query, limit, after)

    def failure(self, campaign_id: str, failure_id: str) -> Episode:
        """The episode with this id in which the ego touched something.

        Raises:
          NotFoundError: there is none.
        """
        run_id, phase, index = _split(failure_id)
        with self._reading() as session:
            campaign = find_campaign(session, campaign_id)
            query = (
                select(EpisodeRow)
                .join(EpisodeRow.run)
                .where(RunRow.campaign_number == campaign.number, RunRow.id == run_id)
                .where(EpisodeRow.phase == phase, EpisodeRow.index == index)
                .where(EpisodeRow.outcome.in_([Outcome.FAILURE, Outcome.DEGENERATE]))
            )
            row = session.scalars(query).one_or_none()
            if row is None:
                raise _unknown_failure(campaign_id, failure_id)
            return _episode(row)

    def next_queued(self) -> Run | None:
        """The run that has waited longest."""
        query = (
            select(RunRow)
            .join(RunRow.campaign)
            .where(RunRow.state == State.QUEUED, CampaignRow.id.not_in(self.unsaved))
            .order_by(RunRow.number)
            .limit(1)
        )
        with self._reading() as session:
            row = session.scalars(query).one_or_none()
            return None if row is None else _run(row)

    @contextmanager
    def _reading(self) -> Iterator[Session]:
        with storage_errors("reading"), Session(self.engine) as session:
            yield session

    def _campaign(self, row: CampaignRow) -> Campaign:
        campaign = campaign_record(row)
        reason = self.unsaved.get(campaign.id)
        return campaign if reason is None else campaign.failed(reason)


@contextmanager
def storage_errors(doing: str) -> Iterator[None]:
    """Turn what the database driver raises into a StorageError with its reason.

    Broken constraints and statements are bugs, not storage, and pass through.
    """
    try:
        yield
    except (IntegrityError, ProgrammingError):
        raise
    except DatabaseError as error:
        raise StorageError(f"storage failed while {doing}: {error.orig}") from error


def find_campaign(session: Session, campaign_id: str) -> CampaignRow:
    """The row with this public id.

    Raises:
      NotFoundError: there is none.
    """
    row = session.scalars(select(CampaignRow).where(CampaignRow.id == campaign_id)).one_or_none()
    if row is None:
        message = f"no campaign has the id {campaign_id!r}; GET /v1/campaigns lists those there are"
        raise NotFoundError(message, field="campaign_id", got=campaign_id)
    return row


def campaign_record(row: CampaignRow) -> Campaign:
    """The snapshot of a row and its runs."""
    return Campaign(
        number=row.number,
        id=row.id,
        spec=CampaignSpec.model_validate_json(row.spec),
        state=State(row.state),
        reason=row.reason,
        created_at=row.created_at,
        started_at=row.started_at,
        finished_at=row.finished_at,
        runs=tuple(_run(run) for run in row.runs),
    )


def _engine(database: Path) -> Engine:
    engine = create_engine(f"sqlite:///{database}")

    @event.listens_for(engine, "connect")
    def _set_up(connection: Connection, _: object) -> None:
        for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000"):
            connection.execute(f"PRAGMA {pragma}").close()

    return engine


def _find_run(campaign: CampaignRow, run_id: str) -> RunRow:
    for run in campaign.runs:
        if run.id == run_id:
            return run
    known = ", ".join(run.id for run in campaign.runs[:10])
    message = f"campaign {campaign.id} has no run {run_id!r}; its runs are {known}"
    raise NotFoundError(message, field="run", got=run_id)


def _episode_page(session: Session, query: Select[EpisodeRow], limit: int, after: int | None) -> Page[Episode]:
    if after is not None:
        query = query.where(EpisodeRow.number > after)
    rows = list(session.scalars(query.order_by(EpisodeRow.number).limit(limit + 1)))
    last = rows[limit - 1].number if len(rows) > limit else None
    return Page(items=tuple(_episode(row) for row in rows[:limit]), last=last)


def _split(failure_id: str) -> tuple[str, str, int]:
    """Run, phase and index; an id of another shape yields a run that cannot exist."""
    run_id, _, rest = failure_id.partition("-train-")
    phase = "train"
    if not rest:
        run_id, _, rest = failure_id.partition("-evaluate-")
        phase = "evaluate"
    well_formed = rest.isascii() and rest.isdigit() and len(rest) < 10
    return (run_id, phase, int(rest)) if well_formed else ("", phase, -1)


def _unknown_failure(campaign_id: str, failure_id: str) -> NotFoundError:
    message = f"campaign {campaign_id} has no failure {failure_id!r}; GET its `failures?tier=raw` lists all contacts"
    return NotFoundError(message, field="failure_id", got=failure_id)


def _run(row: RunRow) -> Run:
    return Run(
        number=row.number,
        campaign_id=row.campaign.id,
        id=row.id,
        family=row.family,
        method=row.method,
        seed=row.seed,
        spec_digest=row.spec_digest,
        state=State(row.state),
        reason=row.reason,
        started_at=row.started_at,
        finished_at=row.finished_at,
        episodes_total=row.episodes_total,
        episodes_done=row.episodes_done,
        rejected=row.rejected,
        raw_collisions=row.raw_collisions,
        failures=row.failures,
        busy_s=row.busy_s,
        metrics=_metrics(row.metrics),
        evaluation=_metrics(row.evaluation),
        digest=row.digest,
        versions=_versions(row.versions),
    )


def _metrics(text: str | None) -> RunMetrics | None:
    return None if text is None else _METRICS.validate_json(text)


def _versions(text: str) -> Mapping[str, str]:
    return _VERSIONS.validate_json(text)


def _episode(row: EpisodeRow) -> Episode:
    return Episode(
        number=row.number,
        run_id=row.run.id,
        record=_RECORD.validate_json(row.record),
        series=row.series,
        wall_s=row.wall_s,
    )
