"""What many ask for while it changes: rendered once for each change, and for no more than a small part of the time."""

import asyncio
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from starlette.concurrency import run_in_threadpool

KEPT = 64  # campaigns that are polled at the same time
NEGLIGIBLE_S = 0.02  # of a processor
SHARE = 0.05  # of one core that the renderings of one campaign may take

T = TypeVar("T")


@dataclass(slots=True)
class _Rendering(Generic[T]):
    revision: str  # of the campaign when it began
    began: float
    task: asyncio.Task[T]
    may_last: bool = True
    lasts_until: float = 0.0

    def shows(self, revision: str) -> bool:
        return self.revision == revision or time.monotonic() < self.lasts_until


class Renderings(Generic[T]):
    """The newest rendering of each campaign.

    It shows what was stored when it was asked for, or later. Only where rendering takes long, because the campaign has
    hundreds of runs, does it last although there is a newer revision: twenty times as long as it took.
    """

    def __init__(self, render: Callable[[str], T]) -> None:
        """Nothing is rendered yet.

        Args:
          render: makes the rendering of a campaign; called in a thread.
        """
        self._render = render
        self._newest: OrderedDict[str, _Rendering[T]] = OrderedDict()

    async def get(self, campaign_id: str, revision: str) -> T:
        """The rendering of a campaign in this revision or a newer one; who asks meanwhile waits for the same.

        Raises:
          ServiceError: as `render` does.
        """
        asked = time.monotonic()
        while True:
            rendering = self._newest.get(campaign_id)
            if rendering is None or (rendering.task.done() and not rendering.shows(revision)):
                rendering = self._begin(campaign_id, revision)
            made = await asyncio.shield(rendering.task)  # others wait for it, too
            if rendering.began >= asked or rendering.shows(revision):
                return made

    def expire(self, campaign_id: str) -> None:
        """Something happened that must show at once, however long rendering takes."""
        rendering = self._newest.get(campaign_id)
        if rendering is not None:
            rendering.may_last = False
            rendering.lasts_until = 0.0

    def _begin(self, campaign_id: str, revision: str) -> _Rendering[T]:
        task = asyncio.create_task(self._make(campaign_id))
        rendering = self._newest[campaign_id] = _Rendering(revision, time.monotonic(), task)
        self._newest.move_to_end(campaign_id)
        if len(self._newest) > KEPT:
            self._newest.popitem(last=False)
        return rendering

    async def _make(self, campaign_id: str) -> T:
        rendering = self._newest[campaign_id]
        try:
            made, took_s = await run_in_threadpool(self._timed, campaign_id)
        except BaseException:
            if self._newest.get(campaign_id) is rendering:
                del self._newest[campaign_id]
            raise
        if rendering.may_last and took_s > NEGLIGIBLE_S:
            rendering.lasts_until = time.monotonic() + took_s / SHARE
        return made

    def _timed(self, campaign_id: str) -> tuple[T, float]:
        began = time.thread_time()
        return self._render(campaign_id), time.thread_time() - began
