"""What has happened in a campaign, in an order that can be taken up anywhere: its episodes and its changes of state."""

from dataclasses import dataclass

from service.store.reading import Store
from service.store.stored import StoredChange, StoredEpisode

BATCH = 100  # at most so many at once

Happening = StoredEpisode | StoredChange


@dataclass(frozen=True, slots=True)
class Batch:
    """What happened next."""

    happenings: tuple[Happening, ...]
    position: int  # sequence of the last one that has been told then; 0: none
    more: bool  # whether more has happened since
    ended: bool  # whether it ends with the campaign's final state


def read_batch(store: Store, campaign_id: str, after: int, limit: int = BATCH) -> Batch:
    """What happened after a position, in the order in which it was written down.

    Raises:
      NotFoundError: there is no such campaign.
      StorageError: it cannot be read.
    """
    page = store.events(campaign_id, after=after, limit=limit)
    return Batch(
        happenings=page.items,
        position=page.items[-1].sequence if page.items else after,
        more=page.last is not None,
        ended=bool(page.items) and _is_end(page.items[-1]),
    )


def _is_end(what: Happening) -> bool:
    """Whether this is the end of the campaign, which nothing follows."""
    return isinstance(what, StoredChange) and what.run_id is None and what.state.final
