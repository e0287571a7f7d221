"""Runs by worker, and the queue in its order."""

from collections import Counter, deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from datetime import datetime

from risk_sac.records import Record, State
from service.runs.cleanup import exhausted
from service.runs.manager import Manager, next_project
from service.settings import ServiceSettings
from service.store.queries import QueuedPlace
from service.store.reading import Store
from service.store.stored import StoredCampaign

MOST_LISTED = 100  # runs that wait
USED_UP = "the project has used up its worker hours of a day"


class ScheduledRun(Record):
    """A run of the caller's project."""

    campaign_id: str
    label: str
    run_id: str
    episodes_done: int
    episodes_total: int


class RunAtWork(ScheduledRun):
    """A run that has a worker."""

    state: State
    slots: int
    """Processes that play its episodes."""
    node: str | None
    """Of a cluster."""
    since: datetime
    """When its present worker was started."""
    silent_s: float | None
    """Since the worker's last sign of life; null before its first."""


class RunWaiting(ScheduledRun):
    """A run that waits."""

    place: int | None
    """In the whole queue; null: it does not start until the reason is gone."""
    reason: str | None


class Workers(Record):
    """Workers and queue of the service; other projects' runs are only counted."""

    slots: int
    """That the runs share."""
    taken: int
    paused: str | None
    """Why no run starts."""
    at_work: list[RunAtWork]
    queued: int
    """All runs that wait."""
    waiting: list[RunWaiting]
    """The first 100 in the order in which they start."""


def workers_body(manager: Manager, store: Store, settings: ServiceSettings, project: str | None) -> Workers:
    """Returns workers and queue as a project sees them; None sees all."""
    active = manager.at_work()
    taken = {each.run.project: 0 for each in active}
    for each in active:
        taken[each.run.project] += each.run.slots
    queued = store.queued()
    out = {name for name in {each.project for each in queued} if exhausted(store.usage(name), settings)}
    places = {number: place for place, number in enumerate(start_order(queued, taken, out), 1)}
    mine = [each.number for each in queued if project in (None, each.project)]
    first = sorted(mine, key=lambda number: (places.get(number, len(queued)), number))[:MOST_LISTED]
    visible = [each for each in active if project in (None, each.run.project)]
    stored = store.campaigns_of([*(each.run.number for each in visible), *first])
    at_work = [
        RunAtWork(
            **_scheduled(stored[each.run.number]),
            state=stored[each.run.number].runs[0].state,
            slots=each.run.slots,
            node=manager.node_of(each.run.number),
            since=datetime.fromtimestamp(each.since).astimezone(),
            silent_s=manager.silent_s(each.run.number),
        )
        for each in visible
        if each.run.number in stored
    ]
    waiting = [
        RunWaiting(
            **_scheduled(stored[number]),
            place=places.get(number),
            reason=stored[number].runs[0].reason if number in places else USED_UP,
        )
        for number in first
        if number in stored
    ]
    return Workers(
        slots=manager.workers,
        taken=sum(taken.values()),
        paused=manager.storage_problem,
        at_work=at_work,
        queued=len(queued),
        waiting=waiting,
    )


def _scheduled(campaign: StoredCampaign) -> Mapping[str, str | int]:
    (run,) = campaign.runs
    counts = {"episodes_done": run.episodes_done, "episodes_total": run.episodes_total}
    return {"campaign_id": campaign.id, "label": campaign.label, "run_id": run.id} | counts


def start_order(queued: Sequence[QueuedPlace], taken: Mapping[str, int], out: Collection[str] = ()) -> Iterator[int]:
    """Yields the numbers of runs in the order of their start.

    Each takes one slot, and none ends.

    Args:
      queued: runs that wait, the oldest first.
      taken: project → slots that it has.
      out: projects whose runs do not start.
    """
    waiting: dict[str, deque[int]] = {}
    for each in queued:
        if each.project not in out:
            waiting.setdefault(each.project, deque()).append(each.number)
    slots = Counter(taken)
    while (project := next_project({name: numbers[0] for name, numbers in waiting.items()}, slots)) is not None:
        yield waiting[project].popleft()
        slots[project] += 1
        if not waiting[project]:
            del waiting[project]
