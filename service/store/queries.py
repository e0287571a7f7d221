"""Queries of campaigns, episodes and events, and counts derived from episodes."""

import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from heapq import merge
from itertools import islice
from operator import attrgetter, itemgetter
from statistics import fmean, median_low
from typing import Any, NamedTuple

from pydantic_core import from_json
from sqlalchemy import ColumnElement, Engine, Row, Select, and_, func, or_, select
from sqlalchemy.orm import Session

from risk_sac.config import FamilyName
from risk_sac.execution.messages import EpisodeDone
from risk_sac.metrics.tally import STEPS
from risk_sac.records import (
    NO_CONTACT,
    DrivenBy,
    Episode,
    EpisodeId,
    EpisodeRecord,
    Fault,
    Funnel,
    Grade,
    Outcome,
    PlausibilityClass,
    Severity,
    State,
    StateChange,
    stored,
)
from risk_sac.scenario.families import density_of
from service.errors import NotFoundError, StorageError
from service.store.database import storage_errors
from service.store.stored import StoredPage, read_episode
from service.store.tables import (
    TALLIED,
    CampaignRow,
    ChangeRow,
    EpisodeRow,
    RequirementRow,
    RunRow,
    TriageRow,
    UsageRow,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """Filter of episodes by driver and verdicts; a None matches any."""

    requirement: str | None = None
    valid: bool = False
    """Whether the requirement must be what makes the episode a failure, and not only violated in it."""
    grade: Grade | None = None
    plausibility: PlausibilityClass | None = None
    severity: Severity | None = None
    fault: Fault | None = None
    driven_by: DrivenBy | None = None
    broke: str | None = None
    kind: str | None = None
    iid: bool = True
    """Whether those of an i.i.d. phase are asked for, too."""

    def conditions(self) -> Iterator[ColumnElement[bool]]:
        """As the database takes them."""
        if self.requirement is not None:
            column = EpisodeRow.failed if self.valid else EpisodeRow.violated
            yield column.contains(f",{self.requirement},", autoescape=True)
        for name in ("grade", "plausibility", "severity", "fault", "driven_by", "kind"):
            if (wanted := getattr(self, name)) is not None:
                yield getattr(EpisodeRow, name) == wanted
        if self.broke is not None:
            yield EpisodeRow.broke.contains(f",{self.broke},", autoescape=True)
        if not self.iid:
            yield EpisodeRow.phase != "iid"


class QueuedPlace(NamedTuple):
    """A run that waits, and its project."""

    number: int
    project: str


def find_campaign(session: Session, campaign_id: str, project: str | None = None) -> CampaignRow:
    """The row with this public id, if it is the project's."""
    # No id has a NUL, and PostgreSQL does not even look for one.
    query = select(CampaignRow).where(CampaignRow.id == campaign_id)
    row = None if "\0" in campaign_id else session.scalars(query).one_or_none()
    if row is None or project not in (None, row.project):
        message = f"no campaign has the id {campaign_id!r}; GET /v1/campaigns lists those there are"
        raise NotFoundError(message, field="campaign_id", got=campaign_id)
    return row


def find_run(session: Session, campaign: CampaignRow, run_id: str) -> int:
    """Number of a campaign's run with this public id."""
    query = select(RunRow.number).filter_by(campaign_number=campaign.number, id=run_id)
    number = None if "\0" in run_id else session.scalar(query)
    if number is not None:
        return number
    known = ", ".join(run.id for run in campaign.runs[:10])
    message = f"campaign {campaign.id} has no run {run_id!r}; its runs are {known}"
    raise NotFoundError(message, field="run", got=run_id)


def weighty_page(
    session: Session, query: Select[EpisodeRow], outcomes: Collection[Outcome], limit: int, after: int | None
) -> StoredPage[Episode]:
    """Returns a page of failures after `after`, most likely and severe first."""
    weight = func.coalesce(EpisodeRow.weight, 0.0)  # refused ones last
    last = None if after is None else session.get(EpisodeRow, after)
    if last is not None:
        at = last.weight or 0.0
        query = query.where(or_(weight < at, and_(weight == at, EpisodeRow.number > last.number)))
    query = query.where(EpisodeRow.outcome.in_(outcomes)).order_by(weight.desc(), EpisodeRow.number)
    return _page(list(session.scalars(query.limit(limit + 1))), limit)


def episode_page(
    session: Session, query: Select[EpisodeRow], outcomes: Collection[Outcome], limit: int, after: int
) -> StoredPage[Episode]:
    """Returns the page of episodes after `after`; no outcomes means all."""
    # A query for each outcome: the index has the order of a page only within one.
    query = query.where(EpisodeRow.number > after).order_by(EpisodeRow.number).limit(limit + 1)
    queries = [query.where(EpisodeRow.outcome == outcome) for outcome in outcomes] or [query]
    found = merge(*(session.scalars(each) for each in queries), key=attrgetter("number"))
    return _page(list(islice(found, limit + 1)), limit)


def _page(rows: Sequence[EpisodeRow], limit: int) -> StoredPage[Episode]:
    last = rows[limit - 1].number if len(rows) > limit else None
    return StoredPage(items=tuple(map(read_episode, rows[:limit])), last=last)


def find_failure(session: Session, campaign: CampaignRow, failure_id: str) -> EpisodeRow:
    """Returns the campaign's failure with this id."""
    wanted = EpisodeId.parse(failure_id)
    row = None if wanted is None else _violation(session, campaign, wanted)
    if row is None:
        message = f"campaign {campaign.id} has no failure {failure_id!r}; GET its `failures?tier=raw` lists them all"
        raise NotFoundError(message, field="failure_id", got=failure_id)
    return row


def _violation(session: Session, campaign: CampaignRow, wanted: EpisodeId) -> EpisodeRow | None:
    query = (
        select(EpisodeRow)
        .join(EpisodeRow.run)
        .where(RunRow.campaign_number == campaign.number, RunRow.id == wanted.run_id)
        .where(EpisodeRow.phase == wanted.phase, EpisodeRow.index == wanted.index)
        .where(EpisodeRow.outcome.in_([Outcome.FAILURE, Outcome.DEGENERATE]))
    )
    return session.scalars(query).one_or_none()


def find_triage(session: Session, episode: EpisodeRow) -> TriageRow | None:
    """The triage of a failure; None without one."""
    place = {"campaign_number": episode.campaign_number, "episode_number": episode.number}
    return session.scalars(select(TriageRow).filter_by(**place)).one_or_none()


HOUR_S = 3600
NEWEST = 40  # number of episodes that tell the pace of a run
STALL = 10.0  # an episode that takes this many medians is left out: compilation, or a machine that stood still
TOUCHED = f",{NO_CONTACT},"


def add_usage(session: Session, project: str, busy_s: float) -> None:
    """Adds worker time to a project's usage in the current hour."""
    hour = int(time.time() // HOUR_S)
    row = session.get(UsageRow, (project, hour))
    if row is None:
        session.add(UsageRow(project=project, hour=hour, busy_s=busy_s))
    else:
        row.busy_s += busy_s


def pace_s(newest_s: Collection[float]) -> float:
    """Returns the mean time of a run's newest episodes, s, without stalls."""
    longest_s = STALL * median_low(newest_s)
    return fmean(each for each in newest_s if each <= longest_s)


def count(run: RunRow, row: EpisodeRow, sign: int) -> None:
    """Adds an episode to its run's counts (+1), or subtracts it (-1)."""
    run.episodes_done += sign
    run.rejected += sign * (row.outcome == Outcome.REJECTED)
    run.raw_collisions += sign * (TOUCHED in (row.violated or ""))
    run.failures += sign * (row.outcome == Outcome.FAILURE)


def tally(run: RunRow) -> None:
    """Copies order-dependent counts from the run's metrics."""
    phases = [from_json(text) for text in (run.metrics, run.evaluation) if text is not None]
    for name in (
        "distinct_failures",
        "preventable",
        "distinct_preventable",
        "distinct_published",
        "headline_candidates",
        "implausible",
    ):
        setattr(run, name, sum(phase.get(name, 0) for phase in phases))
    replayed = [phase for phase in phases if phase.get("headline") is not None]
    run.headline = len({kind for phase in replayed for kind in phase["headline_kinds"]}) if replayed else None
    funnels = [phase.get("requirements", {}) for phase in phases]
    for name in dict.fromkeys(name for each in funnels for name in each):
        row = run.requirements.setdefault(name, RequirementRow(name=name))
        for step in STEPS:
            setattr(row, step, sum(each[name][step] for each in funnels if name in each))


def fill(row: EpisodeRow, family: FamilyName, event: EpisodeDone) -> None:
    """Fills an episode's row from a worker's message."""
    fill_record(row, family, event.record)
    row.series = event.series
    row.series_sha256 = event.series_sha256
    row.wall_s = event.wall_s
    row.funnel = stored(Funnel.of(event.metrics))


def fill_record(row: EpisodeRow, family: FamilyName, record: EpisodeRecord) -> None:
    """Writes an episode's record and the searched columns into its row."""
    row.phase = record.phase
    row.index = record.index
    row.outcome = record.outcome
    row.driven_by = record.driven_by
    row.record = stored(record)
    contact, worst = record.collision, record.worst_violation
    violated = [name for name, result in record.requirements.items() if result.violated_s is not None]
    row.violated = listed(dict.fromkeys([*violated, *([] if contact is None else [NO_CONTACT])]))
    failed = record.outcome is Outcome.FAILURE
    row.failed = listed(each.requirement for each in record.valid_violations) if failed else None
    row.grade = None if worst is None or not failed else worst.graded
    row.plausibility = None if worst is None or not failed or worst.behaviour is None else worst.behaviour.verdict
    row.weight = None if worst is None or not failed else worst.weight(density_of(family)(record.scene))
    row.severity = None if contact is None or not failed else contact.severity
    row.fault = None if worst is None or not failed else worst.blamed
    row.kind = None if worst is None else worst.kind
    row.broke = None if contact is None else listed(contact.judgement.broke)


def listed(names: Iterable[str]) -> str | None:
    """Names as a column has them, each between commas; None without any."""
    found = ",".join(names)
    return f",{found}," if found else None


@dataclass(frozen=True, slots=True)
class Statistics:
    """The whole of it, as rows with names."""

    campaigns: Sequence[Row[Any]]  # state, campaigns
    tallies: Sequence[Row[Any]]  # family, method, state, runs, `TALLIED`
    requirements: Sequence[Row[Any]]  # name, `STEPS`
    at_work: Sequence[Row[Any]]  # campaign_id, id, family, method, metrics of each run that has a worker


def read_statistics(engine: Engine) -> Statistics:
    """Reads the current statistics from the database."""
    campaigns = select(CampaignRow.state, func.count().label("campaigns")).group_by(CampaignRow.state)
    sums = (func.sum(getattr(RunRow, name)).label(name) for name in TALLIED)
    kind = (RunRow.family, RunRow.method, RunRow.state)
    tallies = select(*kind, func.count().label("runs"), *sums).group_by(*kind)
    steps = (func.sum(getattr(RequirementRow, step)).label(step) for step in STEPS)
    requirements = select(RequirementRow.name, *steps).group_by(RequirementRow.name)
    at_work = (
        select(CampaignRow.id.label("campaign_id"), RunRow.id, RunRow.family, RunRow.method, RunRow.metrics)
        .join(RunRow.campaign)
        .where(RunRow.state.in_([State.RUNNING, State.CANCELLING]))
        .order_by(RunRow.number)
    )
    with storage_errors("reading"), engine.connect() as connection:
        return Statistics(*(connection.execute(query).all() for query in (campaigns, tallies, requirements, at_work)))


def check_readable(engine: Engine) -> None:
    """Ask the database for as little as it can be asked for."""
    with storage_errors("reading"), engine.connect() as connection:
        connection.execute(select(CampaignRow.number).limit(1)).first()


def hold_campaigns(session: Session, runs: ColumnElement[bool]) -> list[CampaignRow]:
    """Returns campaigns of these runs; read them before anything else that changes.

    PostgreSQL locks their rows until the transaction ends; SQLite has one writer anyway.
    """
    of_runs = select(RunRow.campaign_number).where(runs)
    query = select(CampaignRow).where(CampaignRow.number.in_(of_runs))
    return list(session.scalars(query.order_by(CampaignRow.number).with_for_update()))  # ordered against deadlocks


def next_sequence(campaign: CampaignRow) -> int:
    """Returns the number of the next event; the campaign must be held."""
    campaign.events += 1
    return campaign.events


def event_page(session: Session, campaign: CampaignRow, limit: int, after: int) -> StoredPage[Episode | StateChange]:
    """Events number `after + 1` and on; StorageError if one is missing."""
    # No further than the campaign said: the two tables are read one after the other, and what is written in between
    # would show in the second one without what came before it.
    last = min(after + limit, campaign.events)
    if last <= after:
        return StoredPage(items=(), last=None)
    episodes = select(EpisodeRow).where(EpisodeRow.sequence.between(after + 1, last))
    changes = select(ChangeRow).where(ChangeRow.sequence.between(after + 1, last))
    events: list[tuple[int, Episode | StateChange]] = []
    for episode in session.scalars(episodes.filter_by(campaign_number=campaign.number)):
        events.append((episode.sequence, read_episode(episode)))
    for change in session.scalars(changes.filter_by(campaign_number=campaign.number)):
        events.append((change.sequence, StateChange.model_validate(change, from_attributes=True)))
    if len(events) != last - after:
        raise StorageError(f"events {after + 1} to {last} of campaign {campaign.id} are {len(events)}; restore a copy")
    items = tuple(event for _, event in sorted(events, key=itemgetter(0)))
    return StoredPage(items=items, last=last if last < campaign.events else None)
