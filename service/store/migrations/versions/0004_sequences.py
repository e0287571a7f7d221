"""One sequence of events per campaign, of its episodes and changes together."""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from itertools import accumulate

import sqlalchemy as sa
from alembic import op
from sqlalchemy import RowMapping

revision = "0004"
down_revision = "0003"

BATCH = 1000  # rows at once
AT_WORK = ("running", "cancelling")  # states in which there is a worker that may report episodes

campaigns = sa.table("campaigns", *map(sa.column, ("number", "events")))
runs = sa.table("runs", *map(sa.column, ("number", "id")))
episodes = sa.table("episodes", *map(sa.column, ("number", "campaign_number", "run_number", "sequence")))
changes = sa.table("changes", *map(sa.column, ("number", "campaign_number", "run_id", "state", "sequence")))


def upgrade() -> None:
    """Numbers what is there: episodes as they came, changes as they came, and each change as early as it can have been.

    When it was among the episodes, nobody wrote down. But a run that came to rest or to its end had no episode later,
    nor had its campaign.
    """
    op.add_column("campaigns", sa.Column("events", sa.Integer, nullable=False, server_default="0"))
    for table in ("episodes", "changes"):
        op.add_column(table, sa.Column("sequence", sa.Integer, nullable=False, server_default="0"))
    for campaign in op.get_bind().execute(sa.select(campaigns).order_by(campaigns.c.number)).mappings().all():
        count = _number_events(campaign["number"])
        if count:
            _write(campaigns, "events", [(campaign, count)])
    op.create_index("episodes_sequence", "episodes", ["campaign_number", "sequence"], unique=True)
    op.drop_index("changes_pages", "changes")
    op.create_index("changes_sequence", "changes", ["campaign_number", "sequence"], unique=True)


def _number_events(campaign: int) -> int:
    """Gives the events of a campaign their numbers; returns how many there are."""
    query = sa.select(changes).where(changes.c.campaign_number == campaign).order_by(changes.c.number)
    told = op.get_bind().execute(query).mappings().all()
    before = _episodes_before(told, _last_episodes(campaign))
    ranks = {0: 0}  # of episodes, by their number
    for page in _episode_pages(campaign):
        ranks |= {episode["number"]: rank for rank, episode in enumerate(page, len(ranks))}
        numbered = [(each, ranks[each["number"]] + bisect_left(before, each["number"])) for each in page]
        _write(episodes, "sequence", numbered)
    places = [place + ranks[episode] for place, episode in enumerate(before, 1)]
    _write(changes, "sequence", list(zip(told, places, strict=True)))
    return len(ranks) - 1 + len(told)


def _episodes_before(ordered: Sequence[RowMapping], last_episodes: dict[str | None, int]) -> list[int]:
    """For each change the number of the last episode that was before it for sure, 0 for none."""
    found, at_work_later = [], set()
    for change in reversed(ordered):
        run = change["run_id"]
        if change["state"] in AT_WORK:
            at_work_later.add(run)
        found.append(0 if run in at_work_later else last_episodes.get(run, 0))
    return list(accumulate(reversed(found), max))


def _last_episodes(campaign: int) -> dict[str | None, int]:
    """The highest number of an episode, by run; of the whole campaign under None."""
    query = (
        sa.select(runs.c.id, sa.func.max(episodes.c.number))
        .join_from(episodes, runs, episodes.c.run_number == runs.c.number)
        .where(episodes.c.campaign_number == campaign)
        .group_by(runs.c.id)
    )
    found: dict[str | None, int] = dict(op.get_bind().execute(query).all())
    return found | {None: max(found.values(), default=0)}


def _episode_pages(campaign: int) -> Iterator[Sequence[RowMapping]]:
    last = 0
    query = sa.select(episodes).where(episodes.c.campaign_number == campaign).order_by(episodes.c.number).limit(BATCH)
    while page := op.get_bind().execute(query.where(episodes.c.number > last)).mappings().all():
        yield page
        last = page[-1]["number"]


def _write(table: sa.TableClause, name: str, numbered: Sequence[tuple[RowMapping, int]]) -> None:
    if numbered:
        changed = sa.update(table).where(table.c.number == sa.bindparam("row"))
        rows = [{"row": row["number"], "to": number} for row, number in numbered]
        op.get_bind().execute(changed.values({name: sa.bindparam("to")}), rows)
