"""Writing the database; the manager holds the only one of these."""

import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager

from pydantic_core import to_json
from sqlalchemy import select
from sqlalchemy.orm import Session

from risk_sac.config import CampaignSpec
from risk_sac.types import EpisodeRecord, Outcome
from service.campaigns import State, advance, campaign_state
from service.errors import StorageError
from service.events import EpisodeDone, Finished
from service.records import Campaign
from service.store import Store, campaign_record, find_campaign, storage_errors
from service.tables import CampaignRow, EpisodeRow, RunRow

_ACTIVE = (State.RUNNING, State.CANCELLING)


class Ledger:
    """Each method is one transaction: it holds entirely or, with a StorageError, not at all."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def create(self, spec: CampaignSpec) -> Campaign:
        """Write a new campaign and its runs down, all queued."""
        row = CampaignRow(id=f"c{secrets.token_hex(8)}", spec=spec.model_dump_json(), state=State.QUEUED)
        row.created_at = time.time()
        row.runs = [
            RunRow(
                id=f"{run.family}-{run.method}-{run.seed}",
                family=run.family,
                method=run.method,
                seed=run.seed,
                spec_digest=run.digest,
                state=State.QUEUED,
                episodes_total=run.budget.episodes + run.budget.evaluation_episodes,
            )
            for run in spec.runs()
        ]
        with self._writing("creating a campaign") as session:
            session.add(row)
            session.flush()
            return campaign_record(row)

    def start_run(self, number: int) -> None:
        """A worker is being launched for this run."""
        with self._run(number, "starting a run") as row:
            row.state = advance(State(row.state), State.RUNNING)
            row.started_at = row.started_at or time.time()

    def add_episode(self, number: int, event: EpisodeDone) -> None:
        """Store an episode, or replace it where a resumed run reports it again."""
        with self._writing("storing an episode") as session:
            run = session.get_one(RunRow, number)
            query = select(EpisodeRow).where(
                EpisodeRow.run_number == number,
                EpisodeRow.phase == event.record.phase,
                EpisodeRow.index == event.record.index,
            )
            row = session.scalars(query).one_or_none()
            if row is None:
                row = EpisodeRow(campaign_number=run.campaign_number, run_number=number)
                session.add(row)
            else:
                _count(run, Outcome(row.outcome), -1)
            _fill(row, event)
            _count(run, event.record.outcome, +1)
            if event.record.phase == "train":
                run.metrics = _json(event.metrics)
            else:
                run.evaluation = _json(event.metrics)
            run.busy_s += event.wall_s

    def end_run(self, number: int, state: State, reason: str | None = None, result: Finished | None = None) -> None:
        """A run reached its end; its campaign ends with the last one."""
        with self._run(number, "ending a run") as row:
            row.state = advance(State(row.state), state)
            row.reason = reason
            row.finished_at = time.time()
            if result is not None:
                row.metrics = _json(result.metrics)
                row.evaluation = None if result.evaluation is None else _json(result.evaluation)
                row.digest = result.digest
                row.versions = _json(dict(result.versions))

    def requeue_run(self, number: int) -> None:
        """The server stops under a run; it will resume from its checkpoint."""
        with self._run(number, "putting a run back in the queue") as row:
            row.state = advance(State(row.state), State.QUEUED)

    def recover(self) -> int:
        """Settle what a server that died left behind; returns how many runs went back to the queue."""
        with self._writing("recovering") as session:
            rows = list(session.scalars(select(RunRow).where(RunRow.state.in_(_ACTIVE))))
            for row in rows:
                interrupted = State(row.state)
                row.state = advance(interrupted, _RESUME[interrupted])
                _settle(row.campaign)
            return sum(row.state == State.QUEUED for row in rows)

    def cancel(self, campaign_id: str) -> list[int]:
        """Cancel what is queued and mark what runs; returns the numbers of the runs to stop.

        Raises:
          NotFoundError: there is no such campaign.
        """
        with self._writing("cancelling a campaign") as session:
            campaign = find_campaign(session, campaign_id)
            if State(campaign.state).final:
                return []
            if campaign.state == State.RUNNING:
                campaign.state = State.CANCELLING
            for run in campaign.runs:
                _cancel(run)
            _settle(campaign)
            return [run.number for run in campaign.runs if run.state == State.CANCELLING]

    def fail(self, campaign_id: str, reason: str) -> None:
        """Fail a campaign and all it has not finished; remembered for later where it cannot be written."""
        self._store.unsaved[campaign_id] = reason
        self.save_failures()

    def save_failures(self) -> None:
        """Write down the failures that the disk refused before."""
        for campaign_id, reason in list(self._store.unsaved.items()):
            try:
                self._fail(campaign_id, reason)
            except StorageError:
                return  # still refused; the manager asks again
            del self._store.unsaved[campaign_id]

    def _fail(self, campaign_id: str, reason: str) -> None:
        with self._writing("failing a campaign") as session:
            campaign = find_campaign(session, campaign_id)
            for run in campaign.runs:
                if not State(run.state).final:
                    run.state = advance(State(run.state), State.FAILED)
                    run.reason = reason
                    run.finished_at = time.time()
            if not State(campaign.state).final:
                campaign.state = advance(State(campaign.state), State.FAILED)
                campaign.finished_at = time.time()
            campaign.reason = reason

    @contextmanager
    def _run(self, number: int, doing: str) -> Iterator[RunRow]:
        with self._writing(doing) as session:
            row = session.get_one(RunRow, number)
            yield row
            _settle(row.campaign)

    @contextmanager
    def _writing(self, doing: str) -> Iterator[Session]:
        with storage_errors(doing), Session(self._store.engine) as session, session.begin():
            yield session


_RESUME = {State.RUNNING: State.QUEUED, State.CANCELLING: State.CANCELLED}


def _settle(campaign: CampaignRow) -> None:
    current = State(campaign.state)
    new = campaign_state(current, [State(run.state) for run in campaign.runs])
    if new is current:
        return
    campaign.state = new
    if new is State.RUNNING:
        campaign.started_at = campaign.started_at or time.time()
    if new.final:
        campaign.finished_at = time.time()
        campaign.reason = next((f"run {run.id}: {run.reason}" for run in campaign.runs if run.reason), None)


def _cancel(run: RunRow) -> None:
    if run.state == State.QUEUED:
        run.state = State.CANCELLED
        run.finished_at = time.time()
    elif run.state == State.RUNNING:
        run.state = State.CANCELLING


def _count(run: RunRow, outcome: Outcome, sign: int) -> None:
    run.episodes_done += sign
    run.rejected += sign * (outcome is Outcome.REJECTED)
    run.raw_collisions += sign * (outcome in (Outcome.FAILURE, Outcome.DEGENERATE))
    run.failures += sign * (outcome is Outcome.FAILURE)


def _fill(row: EpisodeRow, event: EpisodeDone) -> None:
    record: EpisodeRecord = event.record
    row.phase = record.phase
    row.index = record.index
    row.outcome = record.outcome
    row.record = _json(record)
    row.series = event.series
    row.wall_s = event.wall_s


def _json(value: object) -> str:
    return to_json(value, inf_nan_mode="strings").decode()
