"""What has happened in a campaign, in an order that can be taken up anywhere: its episodes and its changes of state."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from service.store.reading import Store
from service.store.records import StoredChange, StoredEpisode

BATCH = 100  # at most so many episodes and so many changes at once


@dataclass(frozen=True, slots=True)
class Position:
    """All episodes and changes up to these numbers have been told; 0: none."""

    episode: int = 0
    change: int = 0


@dataclass(frozen=True, slots=True)
class Happening:
    """One thing that happened."""

    what: StoredEpisode | StoredChange
    position: Position  # once this has been told, too


@dataclass(frozen=True, slots=True)
class Batch:
    """What happened next."""

    happenings: tuple[Happening, ...]
    position: Position  # once all of it has been told
    more: bool  # whether more has happened since
    ended: bool  # whether it ends with the campaign's final state


def read_batch(store: Store, campaign_id: str, after: Position, limit: int = BATCH) -> Batch:
    """What happened after a position: changes and episodes each in their order, ends after all episodes before them.

    Raises:
      NotFoundError: there is no such campaign.
      StorageError: it cannot be read.
    """
    # In this order: when a change says that a run has ended, all its episodes can be read.
    changes = store.changes(campaign_id, after=after.change, limit=limit)
    page = store.episodes(campaign_id, after=after.episode, limit=limit)
    first_end = next((index for index, change in enumerate(changes) if change.state.final), len(changes))
    ends = changes[first_end:] if page.last is None else []
    happenings = tuple(_in_order(after, [*changes[:first_end], *page.items, *ends]))
    return Batch(
        happenings=happenings,
        position=happenings[-1].position if happenings else after,
        more=page.last is not None or len(changes) == limit,
        ended=bool(happenings) and _is_end(happenings[-1].what),
    )


def knows(store: Store, campaign_id: str, position: Position) -> bool:
    """Whether a position is one that this campaign has had.

    Raises:
      NotFoundError: there is no such campaign.
      StorageError: it cannot be read.
    """
    changes = store.changes(campaign_id, after=position.change - 1, limit=1)
    episodes = store.episodes(campaign_id, after=position.episode - 1, limit=1).items
    return all(
        number == 0 or (number > 0 and [each.number for each in found] == [number])
        for number, found in ((position.change, changes), (position.episode, episodes))
    )


def _is_end(what: StoredEpisode | StoredChange) -> bool:
    """Whether this is the end of the campaign, which nothing follows."""
    return isinstance(what, StoredChange) and what.run_id is None and what.state.final


def _in_order(position: Position, told: Sequence[StoredChange | StoredEpisode]) -> Iterator[Happening]:
    for what in told:
        number = {"change" if isinstance(what, StoredChange) else "episode": what.number}
        position = replace(position, **number)
        yield Happening(what, position)
