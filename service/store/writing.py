"""Writing the database; the manager holds the only one of these."""

import secrets
import time
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager

from sqlalchemy import and_, delete, or_, select, tuple_
from sqlalchemy.orm import Session

from risk_sac.config import CampaignSpec
from risk_sac.execution.messages import EpisodeDone, Finished
from risk_sac.records import REPEATS, EpisodeRecord, Outcome, State, Triage, TriageState, stored
from service.errors import ConflictError
from service.store.database import WRITING, storage_errors
from service.store.queries import (
    NEWEST,
    add_usage,
    count,
    fill,
    fill_record,
    find_campaign,
    find_failure,
    find_triage,
    hold_campaigns,
    listed,
    next_sequence,
    pace_s,
    tally,
)
from service.store.reading import Store
from service.store.stored import RESUMED, StoredCampaign, advance, campaign_state
from service.store.tables import (
    IMPORTED,
    CampaignRow,
    ChangeRow,
    EpisodeRow,
    NoticeRow,
    RequirementRow,
    RunRow,
    TriageRow,
)


class Ledger:
    """Writes the database; each method is one transaction, or raises StorageError."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._engine = store.engine.execution_options(**WRITING)
        self._newest_s: dict[int, deque[float]] = {}  # wall times of episodes, by the runs whose worker has told one
        self._repeated_s: dict[int, float] = {}  # time of runs that only repeated what was known

    def find(self, project: str, key: str, spec: CampaignSpec) -> StoredCampaign | None:
        """Finds the campaign created with this idempotency key; ConflictError if it differs."""
        with storage_errors("reading"), Session(self._store.engine) as session:
            row = session.scalars(select(CampaignRow).filter_by(project=project, idempotency_key=key)).one_or_none()
            if row is None:
                return None
            campaign = StoredCampaign.from_row(row, self._store.revision(row.id))
        if campaign.spec != spec:
            message = f"Idempotency-Key {key!r} belongs to campaign {campaign.id}, which differs; wanted another key"
            raise ConflictError(message, reason="idempotency_key_reused")
        return campaign

    def create(
        self, spec: CampaignSpec, project: str = "default", key: str | None = None, base_url: str = ""
    ) -> StoredCampaign:
        """Stores a new campaign with its runs, all queued.

        The message to its end links below the base URL.
        """
        row = CampaignRow(id=f"c{secrets.token_hex(8)}", project=project, idempotency_key=key, label=spec.label)
        row.tags = listed(spec.tags)
        row.spec, row.state, row.created_at = spec.model_dump_json(), State.QUEUED, time.time()
        row.runs = [
            RunRow(
                id=run.id,
                family=run.family,
                method=run.method,
                seed=run.seed,
                spec_digest=run.digest,
                state=State.QUEUED,
                episodes_total=run.budget.total_episodes,
            )
            for run in spec.runs()
        ]
        with self._writing("creating a campaign") as session:
            session.add(row)
            session.flush()
            if spec.on_end is not None:
                link = f"{base_url}v1/campaigns/{row.id}"
                session.add(NoticeRow(campaign_number=row.number, url=spec.on_end, link=link))
            return StoredCampaign.from_row(row, str(row.revision))

    def start_run(self, number: int, processes: int = 1) -> None:
        """Notes that a run's worker starts, with this many rollout processes."""
        with self._run(number, "starting a run") as (session, row):
            _move(session, row, State.RUNNING)
            row.started_at = row.started_at or time.time()
            row.attempts += 1
            row.processes = processes
            self._newest_s.pop(number, None)

    def add_episodes(self, events: Sequence[tuple[int, EpisodeDone]]) -> set[int]:
        """Stores episodes by run number; replaces those that resumed runs change.

        Returns:
          Numbers of the runs to which one was new.
        """
        with self._writing("storing episodes") as session:
            of_these = RunRow.number.in_({number for number, _ in events})
            campaigns = {campaign.number: campaign for campaign in hold_campaigns(session, of_these)}
            runs = {run.number: run for run in session.scalars(select(RunRow).where(of_these))}
            known = _known_episodes(session, events)
            grown, changed = set(), set()
            for number, event in events:
                run, row = runs[number], known.get(_place(number, event))
                campaign = campaigns[run.campaign_number]
                self._repeated_s[number] = self._repeated_s.get(number, 0.0) + event.wall_s
                newest_s = self._newest_s.get(number)
                if newest_s is None:  # its time includes the start of the worker
                    self._newest_s[number] = deque(maxlen=NEWEST)
                if row is not None and row.record == stored(event.record) and row.series_sha256 == event.series_sha256:
                    continue
                if row is None:
                    grown.add(number)
                    row = known[_place(number, event)] = EpisodeRow(
                        campaign_number=campaign.number, run_number=number, sequence=next_sequence(campaign)
                    )
                    session.add(row)
                else:
                    count(run, row, -1)
                fill(row, run.family, event)
                count(run, row, +1)
                if newest_s is not None:
                    newest_s.append(event.wall_s)
                    run.pace_s = pace_s(newest_s)
                if event.record.evaluating:
                    run.evaluation = stored(event.metrics)
                else:
                    run.metrics = stored(event.metrics)
                changed.add(number)
            for number in changed:
                run = runs[number]
                campaign = campaigns[run.campaign_number]
                tally(run)
                run.busy_s += self._repeated_s[number]
                add_usage(session, campaign.project, self._repeated_s[number])
                campaign.revision += 1  # its state follows those of its runs, which an episode leaves alone
        for number in changed:
            del self._repeated_s[number]
        return grown

    def end_run(self, number: int, state: State, reason: str | None = None, result: Finished | None = None) -> None:
        """Ends a run, and its campaign with the last one."""
        with self._run(number, "ending a run") as (session, row):
            self._newest_s.pop(number, None)
            _move(session, row, state, reason)
            row.finished_at = time.time()
            if result is not None:
                row.metrics = stored(result.metrics)
                row.evaluation = None if result.evaluation is None else stored(result.evaluation)
                tally(row)
                row.digest = result.digest
                row.versions = stored(dict(result.versions))
                _refuse(session, row, result.flaky)
                row.repetitions = stored(dict(result.repetitions)) if result.repetitions else None

    def requeue_run(self, number: int, reason: str | None = None) -> None:
        """Queues a run that lost its worker; it resumes from its checkpoint."""
        with self._run(number, "putting a run back in the queue") as (session, row):
            _move(session, row, State.QUEUED, reason)

    def pause(self, numbers: Collection[int], reason: str) -> None:
        """Pauses those of these runs that are at work."""
        with self._writing("pausing") as session:
            paused = RunRow.number.in_(numbers)
            hold_campaigns(session, paused)
            for row in session.scalars(select(RunRow).where(paused)):
                if row.state == State.RUNNING:
                    _move(session, row, State.PAUSED, reason)
                    _settle(session, row.campaign)

    def resume(self) -> int:
        """Queues or cancels runs without worker; returns the number queued.

        Those of imports, which never have one, are left alone.
        """
        key = CampaignRow.idempotency_key
        posted = RunRow.campaign.has(or_(key.is_(None), ~key.startswith(IMPORTED)))
        with self._writing("resuming") as session:
            interrupted = and_(RunRow.state.in_(RESUMED), posted)
            hold_campaigns(session, interrupted)
            rows = list(session.scalars(select(RunRow).where(interrupted)))
            for row in rows:
                _move(session, row, RESUMED[State(row.state)])
                _settle(session, row.campaign)
            return sum(row.state == State.QUEUED for row in rows)

    def cancel(self, campaign_id: str, project: str | None = None) -> list[int]:
        """Cancels queued runs and marks running ones; returns the runs to stop."""
        with self._writing("cancelling a campaign") as session:
            campaign = find_campaign(session, campaign_id, project)
            session.refresh(campaign, with_for_update=True)  # held, as by `hold_campaigns`
            if State(campaign.state).final:
                return []
            running = [run for run in campaign.runs if run.state == State.RUNNING]
            if running and campaign.state != State.CANCELLING:
                campaign.state = advance(State(campaign.state), State.CANCELLING)
                _log(session, campaign, None, State.CANCELLING, None)
            for run in campaign.runs:
                if run in running:
                    _move(session, run, State.CANCELLING)
                elif run.state in (State.QUEUED, State.PAUSED):
                    _move(session, run, State.CANCELLED)
                    run.finished_at = time.time()
            _settle(session, campaign)
            return [run.number for run in campaign.runs if run.state == State.CANCELLING]

    def triage(
        self, campaign_id: str, failure_id: str, state: TriageState, comment: str, project: str | None = None
    ) -> Triage:
        """Stores the triage of a failure; storing the same again changes nothing."""
        with self._writing("storing a triage") as session:
            campaign = find_campaign(session, campaign_id, project)
            session.refresh(campaign, with_for_update=True)  # held, as by `hold_campaigns`
            episode = find_failure(session, campaign, failure_id)
            row = find_triage(session, episode)
            if row is None:
                row = TriageRow(campaign_number=campaign.number, episode_number=episode.number)
                session.add(row)
            elif (row.state, row.comment) == (state, comment):
                return Triage.model_validate(row, from_attributes=True)
            row.state, row.comment, row.changed_at = state, comment, time.time()
            campaign.revision += 1
            return Triage.model_validate(row, from_attributes=True)

    def tag(self, campaign_id: str, tags: Sequence[str], project: str | None = None) -> None:
        """Replaces the tags of a campaign; storing the same again changes nothing."""
        with self._writing("tagging a campaign") as session:
            campaign = find_campaign(session, campaign_id, project)
            session.refresh(campaign, with_for_update=True)  # held, as by `hold_campaigns`
            campaign.revision += campaign.tags != listed(tags)
            campaign.tags = listed(tags)

    def note_try(self, campaign_id: str, reason: str | None, due_at: float | None = None) -> None:
        """Notes a try to deliver the message to a campaign's end.

        Args:
          campaign_id: of the campaign; one that was deleted meanwhile is left alone.
          reason: why it failed; None if it was delivered.
          due_at: time of the next try, s since the epoch; None after the last one.
        """
        with self._writing("noting a delivery") as session:
            row = session.scalar(select(NoticeRow).join(CampaignRow).where(CampaignRow.id == campaign_id))
            if row is None:
                return
            campaign = session.get_one(CampaignRow, row.campaign_number, with_for_update=True)
            row.tries, row.reason, row.due_at = row.tries + 1, reason, due_at or row.due_at
            if reason is None or due_at is None:
                row.state = "delivered" if reason is None else "failed"
            campaign.revision += 1

    def delete(self, campaign_id: str) -> None:
        """Deletes a campaign with all its rows."""
        with self._writing("deleting a campaign") as session:
            number = find_campaign(session, campaign_id).number
            session.expunge_all()
            runs = select(RunRow.number).filter_by(campaign_number=number)
            session.execute(delete(RequirementRow).where(RequirementRow.run_number.in_(runs)))
            for table in (NoticeRow, TriageRow, EpisodeRow, ChangeRow, RunRow):
                session.execute(delete(table).where(table.campaign_number == number))
            session.execute(delete(CampaignRow).where(CampaignRow.number == number))
        self._store.revisions.forget(campaign_id)

    @contextmanager
    def _run(self, number: int, doing: str) -> Iterator[tuple[Session, RunRow]]:
        with self._writing(doing) as session:
            (campaign,) = hold_campaigns(session, RunRow.number == number)
            yield session, session.get_one(RunRow, number)
            _settle(session, campaign)

    @contextmanager
    def _writing(self, doing: str) -> Iterator[Session]:
        with storage_errors(doing), Session(self._engine, expire_on_commit=False) as session:
            with session.begin():
                yield session
            for row in session.identity_map.values():
                if isinstance(row, CampaignRow):
                    self._store.revisions.note(row.id, row.project, row.revision)


def _refuse(session: Session, run: RunRow, flaky: Mapping[int, Collection[str]]) -> None:
    """Removes from a run's failures those violations that do not repeat."""
    if not flaky:
        return
    failures = select(EpisodeRow).filter_by(run_number=run.number, outcome=Outcome.FAILURE)
    for row in session.scalars(failures):
        if row.index not in flaky:  # asked here: a statement has a limit on parameters
            continue
        count(run, row, -1)
        record = EpisodeRecord.model_validate_json(row.record)
        fill_record(row, run.family, record.refused(REPEATS, flaky[row.index]))
        count(run, row, +1)


Place = tuple[int, str, int]
"""Where an episode belongs: number of its run, phase, index."""


def _place(number: int, event: EpisodeDone) -> Place:
    return number, event.record.phase, event.record.index


def _known_episodes(session: Session, events: Sequence[tuple[int, EpisodeDone]]) -> dict[Place, EpisodeRow]:
    place = tuple_(EpisodeRow.run_number, EpisodeRow.phase, EpisodeRow.index)
    query = select(EpisodeRow).where(place.in_([_place(number, event) for number, event in events]))
    return {(row.run_number, row.phase, row.index): row for row in session.scalars(query)}


def _move(session: Session, run: RunRow, state: State, reason: str | None = None) -> None:
    run.state = advance(State(run.state), state)
    run.reason = reason
    _log(session, run.campaign, run.id, state, reason)


def _settle(session: Session, campaign: CampaignRow) -> None:
    """Derives a campaign's state from its runs and raises its revision."""
    campaign.revision += 1
    current = State(campaign.state)
    # What states there are, without the runs themselves: they may be thousands, and each start and end comes by here.
    states = session.scalars(select(RunRow.state).filter_by(campaign_number=campaign.number).distinct())
    new = campaign_state(current, {State(state) for state in states})
    if new is current:
        return
    campaign.state = new
    reasons = (f"run {run.id}: {run.reason}" for run in campaign.runs if run.reason and run.state == new)
    campaign.reason = next(reasons, None)
    if new is State.RUNNING:
        campaign.started_at = campaign.started_at or time.time()
    if new.final:
        campaign.finished_at = time.time()
    _log(session, campaign, None, new, campaign.reason)


def _log(session: Session, campaign: CampaignRow, run_id: str | None, state: State, reason: str | None) -> None:
    row = ChangeRow(campaign_number=campaign.number, run_id=run_id, state=state, reason=reason, at=time.time())
    row.sequence = next_sequence(campaign)
    session.add(row)
