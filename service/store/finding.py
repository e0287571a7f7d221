"""Finds rows by public ids, and pages of filtered rows."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from heapq import merge
from itertools import islice
from operator import attrgetter

from sqlalchemy import ColumnElement, Select, select
from sqlalchemy.orm import Session

from risk_sac.records import DrivenBy, Episode, EpisodeId, Fault, Grade, Outcome, PlausibilityClass, Severity
from service.errors import NotFoundError
from service.store.stored import StoredPage, read_episode
from service.store.tables import CampaignRow, EpisodeRow, RunRow, TriageRow


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """Filter of episodes by what drove them and by their verdicts; None: any."""

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


def episode_page(
    session: Session, query: Select[EpisodeRow], outcomes: Collection[Outcome], limit: int, after: int
) -> StoredPage[Episode]:
    """Returns the page of a query's episodes after number `after`; no outcomes means all."""
    # A query for each outcome: the index has the order of a page only within one.
    query = query.where(EpisodeRow.number > after).order_by(EpisodeRow.number).limit(limit + 1)
    queries = [query.where(EpisodeRow.outcome == outcome) for outcome in outcomes] or [query]
    found = merge(*(session.scalars(each) for each in queries), key=attrgetter("number"))
    rows = list(islice(found, limit + 1))
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
