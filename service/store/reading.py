"""Reads the database; only the manager writes, in `service.store.writing`."""

import threading
import time
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from statistics import median
from typing import NamedTuple

from pydantic_core import from_json
from sqlalchemy import and_, func, or_, select
from sqlalchemy.orm import Session, joinedload, selectinload

from risk_sac.records import FINAL, EndNotice, Episode, EpisodeRecord, Outcome, State, StateChange, Triage, TriageState
from service.errors import StorageError
from service.store.database import connect, open_database, storage_errors
from service.store.queries import (
    HOUR_S,
    Judged,
    QueuedPlace,
    episode_page,
    event_page,
    find_campaign,
    find_failure,
    find_run,
    find_triage,
    weighty_page,
)
from service.store.stored import StoredCampaign, StoredFailure, StoredPage, StoredRecord, Usage, read_episode
from service.store.tables import IMPORTED, CampaignRow, EpisodeRow, NoticeRow, RunRow, TriageRow, UsageRow

DAY_HOURS = 24
BATCH = 1000  # rows in memory at once
NEWEST_RUNS = 1000  # that tell how long an episode takes
NOTICES = 20  # messages that are read at once
DRIVERS = ("driver", "profile")  # fields of an ego that name it


class Known(NamedTuple):
    """A campaign that was read or written."""

    project: str
    revision: int


class DueNotice(NamedTuple):
    """Due message about a campaign's end."""

    campaign_id: str
    url: str
    link: str
    tries: int


class Revisions:
    """Campaigns' revisions in memory, so that a poll needs no database.

    Attributes:
      all: how often any campaign was written since the start.
    """

    def __init__(self) -> None:
        self.all = 0
        self._known: dict[str, Known] = {}
        self._lock = threading.Lock()

    def get(self, campaign_id: str) -> Known | None:
        """The revision of one campaign; None before its first read or write."""
        return self._known.get(campaign_id)

    def learn(self, campaign_id: str, project: str, revision: int) -> int:
        """Stores and returns a revision, or the newer one that is known."""
        with self._lock:
            known = self._known.get(campaign_id)
            if known is None or known.revision < revision:
                known = self._known[campaign_id] = Known(project, revision)
            return known.revision

    def note(self, campaign_id: str, project: str, revision: int) -> None:
        """Notes the revision that was written."""
        with self._lock:
            self._known[campaign_id] = Known(project, revision)
            self.all += 1

    def forget(self, campaign_id: str) -> None:
        """Drops a campaign that was deleted."""
        with self._lock:
            self._known.pop(campaign_id, None)
            self.all += 1


class Store:
    """Snapshots of campaigns, runs and episodes.

    Attributes:
      engine: the database.
      revisions: of campaigns, in memory.
      refusal: why the disk refuses, while it does. Campaigns at work are then shown as paused: the disk that stops
        them may refuse the note about it, too.
    """

    def __init__(self, url: str, *, opened: bool = False) -> None:
        """Opens the database, creating it if missing; connects if already `opened`."""
        self.engine = connect(url) if opened else open_database(url)
        self.refusal: str | None = None
        self.revisions = Revisions()

    def close(self) -> None:
        """Closes all connections."""
        self.engine.dispose()

    def campaign(self, campaign_id: str, project: str | None = None) -> StoredCampaign:
        """The campaign with this id."""
        with self._reading() as session:
            return self._campaign(find_campaign(session, campaign_id, project))

    def campaigns(
        self,
        limit: int,
        before: int | None = None,
        *,
        project: str | None = None,
        state: State | None = None,
        family: str | None = None,
        method: str | None = None,
        label: str | None = None,
        tag: str | None = None,
        search: str | None = None,
    ) -> StoredPage[StoredCampaign]:
        """Newest first, from the campaign just older than number `before`.

        Family and method are those of one run; each word of `search` occurs in the label or the id.
        """
        query = select(CampaignRow).options(selectinload(CampaignRow.runs)).order_by(CampaignRow.number.desc())
        wanted = {"project": project, "state": state, "label": label}
        query = query.filter_by(**{name: value for name, value in wanted.items() if value is not None})
        run = {name: value for name, value in (("family", family), ("method", method)) if value is not None}
        if run:
            query = query.where(CampaignRow.number.in_(select(RunRow.campaign_number).filter_by(**run)))
        if tag is not None:
            query = query.where(CampaignRow.tags.contains(f",{tag},", autoescape=True))
        for word in (search or "").split():
            found = (column.icontains(word, autoescape=True) for column in (CampaignRow.label, CampaignRow.id))
            query = query.where(or_(*found))
        if before is not None:
            query = query.where(CampaignRow.number < before)
        with self._reading() as session:
            rows = list(session.scalars(query.limit(limit + 1)))
            last = rows[limit - 1].number if len(rows) > limit else None
            return StoredPage(items=tuple(self._campaign(row) for row in rows[:limit]), last=last)

    def campaigns_of_ego(self, name: str, project: str | None, limit: int) -> list[StoredCampaign]:
        """Returns the newest campaigns of an ego or profile, oldest first."""
        # JSON as it is stored has no spaces, and a quotation mark inside a text has a backslash before it.
        driver, profile = (CampaignRow.spec.contains(f'"{key}":"{name}"', autoescape=True) for key in DRIVERS)
        of_sumo = and_(profile, CampaignRow.spec.contains('"driver":null'))
        query = select(CampaignRow).options(selectinload(CampaignRow.runs)).where(or_(driver, of_sumo))
        if project is not None:
            query = query.filter_by(project=project)
        with self._reading() as session:
            rows = session.scalars(query.order_by(CampaignRow.number.desc()).limit(limit))
            return [self._campaign(row) for row in rows][::-1]

    def notice(self, campaign_number: int) -> EndNotice | None:
        """Returns the message to the end of a campaign, None without one."""
        with self._reading() as session:
            row = session.get(NoticeRow, campaign_number)
            return None if row is None else EndNotice.model_validate(row, from_attributes=True)

    def due_notices(self, now: float) -> list[DueNotice]:
        """Returns the messages of ended campaigns that are due."""
        due = CampaignRow.state.in_(FINAL), NoticeRow.state == "waiting", NoticeRow.due_at <= now
        query = select(NoticeRow, CampaignRow.id).join(CampaignRow).where(*due).order_by(NoticeRow.due_at)
        with self._reading() as session:
            rows = session.execute(query.limit(NOTICES))
            return [DueNotice(id_, row.url, row.link, row.tries) for row, id_ in rows]

    def revision(self, campaign_id: str, project: str | None = None) -> str:
        """Returns a campaign's revision, which changes with its runs and episodes."""
        known = self.known_revision(campaign_id, project)
        if known is not None:
            return known
        with self._reading() as session:
            row = find_campaign(session, campaign_id, project)
            return self._shown_revision(self.revisions.learn(row.id, row.project, row.revision))

    def known_revision(self, campaign_id: str, project: str | None = None) -> str | None:
        """Returns the revision if it is in memory, else None."""
        known = self.revisions.get(campaign_id)
        if known is None or project not in (None, known.project):
            return None
        return self._shown_revision(known.revision)

    def revision_of_all(self) -> str:
        """Returns the revision of all campaigns, valid until a restart."""
        return self._shown_revision(self.revisions.all)

    def events(self, campaign_id: str, *, limit: int, after: int = 0) -> StoredPage[Episode | StateChange]:
        """Returns a campaign's episodes and state changes in event order, after `after`."""
        with self._reading() as session:
            return event_page(session, find_campaign(session, campaign_id), limit, after)

    def count_of_events(self, campaign_id: str) -> int:
        """Returns the number of events, which is the newest one's sequence."""
        with self._reading() as session:
            return find_campaign(session, campaign_id).events

    def episodes(
        self,
        campaign_id: str,
        *,
        limit: int,
        after: int | None = None,
        run_id: str | None = None,
        outcomes: Collection[Outcome] = (),
        judged: Judged | None = None,
        weighty: bool = False,
        project: str | None = None,
    ) -> StoredPage[Episode]:
        """Returns episodes after number `after`.

        Args:
          campaign_id: of the campaign.
          limit: at most so many.
          after: number of the last one of the page before.
          run_id: only those of this run.
          outcomes: only these; none means all, unless they are ordered by weight.
          judged: filter by what drove them and by their verdicts.
          weighty: the most likely and severe first, instead of in order of arrival.
          project: that the campaign must belong to.
        """
        with self._reading() as session:
            campaign = find_campaign(session, campaign_id, project)
            if run_id is None:
                query = select(EpisodeRow).where(EpisodeRow.campaign_number == campaign.number)
            else:  # without the campaign's number, which would let the database choose a slower index
                query = select(EpisodeRow).where(EpisodeRow.run_number == find_run(session, campaign, run_id))
            query = query if judged is None else query.where(*judged.conditions())
            if weighty:
                return weighty_page(session, query, outcomes, limit, after)
            return episode_page(session, query, outcomes, limit, after or 0)

    def records(self, number: int, outcomes: Collection[Outcome] = ()) -> Iterator[StoredRecord]:
        """Yields search episodes in order of arrival; no outcomes means all."""
        row = EpisodeRow
        query = select(row.number, row.run_number, row.record)
        query = query.where(row.campaign_number == number, *Judged(iid=False).conditions()).order_by(row.number)
        if outcomes:
            query = query.where(row.outcome.in_(outcomes))
        with self._reading() as session:
            for number, run_number, record in session.execute(query.execution_options(yield_per=BATCH)):
                yield StoredRecord(number, run_number, EpisodeRecord.model_validate_json(record))

    def failure(self, campaign_id: str, failure_id: str, project: str | None = None) -> StoredFailure:
        """Returns the failure with this id."""
        with self._reading() as session:
            campaign = find_campaign(session, campaign_id, project)
            row = find_failure(session, campaign, failure_id)
            return StoredFailure(read_episode(row), row.series, row.series_sha256)

    def own_requirements(self, campaign_id: str, project: str | None = None) -> list[str]:
        """Names of the requirements that were posted with a campaign."""
        with self._reading() as session:
            spec = from_json(find_campaign(session, campaign_id, project).spec)
            return [requirement["name"] for requirement in spec["requirements"]]

    def triage(self, campaign_id: str, failure_id: str, project: str | None = None) -> Triage | None:
        """The triage of the failure with this id; None without one."""
        with self._reading() as session:
            campaign = find_campaign(session, campaign_id, project)
            row = find_triage(session, find_failure(session, campaign, failure_id))
            return None if row is None else Triage.model_validate(row, from_attributes=True)

    def triages(self, number: int) -> dict[int, TriageState]:
        """Triage states of a campaign's failures, by the numbers of the episodes."""
        with self._reading() as session:
            rows = session.scalars(select(TriageRow).filter_by(campaign_number=number))
            return {row.episode_number: TriageState(row.state) for row in rows}

    def waiting(self) -> dict[str, int]:
        """Returns the number of the oldest queued run of each project."""
        query = (
            select(CampaignRow.project, func.min(RunRow.number).label("number"))
            .join(RunRow.campaign)
            .where(RunRow.state == State.QUEUED)
            .group_by(CampaignRow.project)
        )
        with self._reading() as session:
            return {row.project: row.number for row in session.execute(query)}

    def campaign_of(self, number: int) -> StoredCampaign:
        """Returns the campaign of an existing run, without its other runs."""
        with self._reading() as session:
            row = session.get_one(RunRow, number)
            campaign = row.campaign
            return StoredCampaign.from_row(campaign, self._shown_revision(campaign.revision), alone=row)

    def campaigns_of(self, numbers: Collection[int]) -> dict[int, StoredCampaign]:
        """Returns the campaigns of runs that exist, each with its run alone."""
        query = select(RunRow).options(joinedload(RunRow.campaign)).where(RunRow.number.in_(numbers))
        with self._reading() as session:
            return {
                row.number: StoredCampaign.from_row(row.campaign, str(row.campaign.revision), alone=row)
                for row in session.scalars(query)
            }

    def queued(self) -> list[QueuedPlace]:
        """Returns all runs that wait, the oldest first."""
        query = select(RunRow.number, CampaignRow.project).join(RunRow.campaign).where(RunRow.state == State.QUEUED)
        with self._reading() as session:
            return [QueuedPlace(*row) for row in session.execute(query.order_by(RunRow.number))]

    def usage(self, project: str) -> Usage:
        """Returns a project's current usage."""
        queued = (
            select(func.count())
            .select_from(RunRow)
            .join(RunRow.campaign)
            .where(CampaignRow.project == project, RunRow.state == State.QUEUED)
        )
        oldest = int(time.time() // HOUR_S) - DAY_HOURS
        hours = select(UsageRow).where(UsageRow.project == project, UsageRow.hour > oldest)
        with self._reading() as session:
            cpu_s = sum(row.busy_s for row in session.scalars(hours))
            return Usage(queued_runs=session.scalar(queued) or 0, cpu_s=cpu_s)

    def ended_before(self, moment: float, limit: int) -> list[str]:
        """Returns campaigns that ended before a moment (epoch s), oldest first."""
        query = select(CampaignRow.id).where(CampaignRow.state.in_(FINAL), CampaignRow.finished_at < moment)
        with self._reading() as session:
            return list(session.scalars(query.order_by(CampaignRow.number).limit(limit)))

    def begun_imports(self) -> list[str]:
        """Returns ids of campaigns whose import is not finished."""
        query = select(CampaignRow.id).where(
            CampaignRow.idempotency_key.startswith(IMPORTED), CampaignRow.state.not_in(FINAL)
        )
        with self._reading() as session:
            return list(session.scalars(query))

    def families(self) -> set[str]:
        """All that any campaign names."""
        with self._reading() as session:
            return set(session.scalars(select(RunRow.family).distinct()))

    def episode_times(self) -> dict[str, dict[str, float]]:
        """Returns slot seconds per episode by family and method: newest runs' median."""
        query = select(RunRow.family, RunRow.method, RunRow.pace_s * func.coalesce(RunRow.processes, 1))
        query = query.where(RunRow.pace_s.is_not(None)).order_by(RunRow.number.desc()).limit(NEWEST_RUNS)
        times: dict[str, dict[str, list[float]]] = {}
        with self._reading() as session:
            for family, method, slot_s in session.execute(query):
                if slot_s is not None:
                    times.setdefault(family, {}).setdefault(method, []).append(slot_s)
        return {family: {method: median(each) for method, each in methods.items()} for family, methods in times.items()}

    def priors(self) -> set[str]:
        """All copies of earlier scripts that any campaign names."""
        query = select(CampaignRow.spec).where(CampaignRow.spec.contains('"prior":"'))
        with self._reading() as session:
            return {from_json(spec)["prior"] for spec in session.scalars(query)}

    def exists(self, campaign_id: str) -> bool:
        """Whether there is a campaign with this id."""
        with self._reading() as session:
            return session.scalar(select(CampaignRow.number).where(CampaignRow.id == campaign_id)) is not None

    @contextmanager
    def _reading(self) -> Iterator[Session]:
        with storage_errors("reading"), Session(self.engine) as session:
            try:
                yield session
            except ValueError as error:  # pydantic's, too
                reason = str(error).partition("\n")[0]
                raise StorageError(f"a row is damaged ({reason}); restore the database from a copy") from error

    def _campaign(self, row: CampaignRow) -> StoredCampaign:
        campaign = StoredCampaign.from_row(row, self._shown_revision(row.revision))
        at_work = campaign.state in (State.RUNNING, State.PAUSED)
        return campaign.paused(self.refusal) if self.refusal is not None and at_work else campaign

    def _shown_revision(self, revision: int) -> str:
        return f"{revision}" if self.refusal is None else f"{revision}-{zlib.crc32(self.refusal.encode()):x}"
