"""Total order of a campaign's events: episodes and state changes.

Each takes the campaign's next number in the transaction that writes it and holds the campaign's row. So numbers become
visible in order and without gaps: a reader of one has seen all before it.
"""

from operator import itemgetter

from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from risk_sac.records import Episode, StateChange
from service.errors import StorageError
from service.store.stored import StoredPage, read_episode
from service.store.tables import CampaignRow, ChangeRow, EpisodeRow, RunRow


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
    found: list[tuple[int, Episode | StateChange]] = []
    for episode in session.scalars(episodes.filter_by(campaign_number=campaign.number)):
        found.append((episode.sequence, read_episode(episode)))
    for change in session.scalars(changes.filter_by(campaign_number=campaign.number)):
        found.append((change.sequence, StateChange.model_validate(change, from_attributes=True)))
    if len(found) != last - after:
        raise StorageError(f"events {after + 1} to {last} of campaign {campaign.id} are {len(found)}; restore a copy")
    items = tuple(event for _, event in sorted(found, key=itemgetter(0)))
    return StoredPage(items=items, last=last if last < campaign.events else None)
