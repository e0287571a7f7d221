"""The cache of answers: an answer is given again to those who may see it, until the revision that it shows has passed.

The cache stands before the router, because finding and calling a route costs several times as much as a kept answer.
"""

import asyncio
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fastapi import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.access import CALLER
from service.api.answers.representations import Representation
from service.store.reading import Store

MOST_BYTES = 16 << 20  # of all kept answers
OVERHEAD_BYTES = 2000  # of each answer, about, beside its body and the request
ANSWER = "risk_sac.answer"  # in the ASGI scope: what a route wants to have kept
FROM_CACHE = "risk_sac.from_cache"  # in the ASGI scope: set where a kept answer was given

Asked = tuple[str | None, str, bytes]  # the only project that the caller sees (None: all), path and query


@dataclass(frozen=True, slots=True)
class KeptAnswer:
    """An answer with the revision that makes it valid."""

    representation: Representation
    revision: str  # read before the representation was made, so that it is never newer
    campaign_id: str | None  # whose revision it is; None: the one of all campaigns together
    routed: Mapping[str, Any]  # what the router leaves in the scope for the log and the metrics

    @property
    def size(self) -> int:
        """Memory that it takes, bytes, about."""
        return len(self.representation.body) + OVERHEAD_BYTES

    def valid(self, store: Store) -> bool:
        """Whether nothing has changed since."""
        campaign_id = self.campaign_id
        return self.revision == (store.revision_of_all() if campaign_id is None else store.known_revision(campaign_id))


def keep(request: Request, representation: Representation, revision: str, campaign_id: str | None = None) -> None:
    """Hand an answer to the cache.

    Args:
      request: which the answer belongs to.
      representation: the answer; it may depend on the project that the caller sees, the path and the query alone.
      revision: of what it shows, read before it was made.
      campaign_id: whose revision that is; None: the one of all campaigns together.
    """
    routed = {name: request.scope[name] for name in ("route", "path_params")}
    request.scope[ANSWER] = KeptAnswer(representation, revision, campaign_id, routed)


class AnswerCache:
    """ASGI middleware, behind the guards: whoever gets here may ask what they ask."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._answers: OrderedDict[Asked, KeptAnswer] = OrderedDict()  # the one made longest ago first
        self._renewals: dict[Asked, asyncio.Event] = {}  # set once a new answer is there, or is known to fail
        self._bytes = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Give the kept answer while it is valid, else have a route make one."""
        if scope["type"] != "http" or scope["method"] != "GET" or CALLER not in scope:
            await self._app(scope, receive, send)
            return
        asked: Asked = (scope[CALLER].sees, scope["path"], scope["query_string"])
        answer = await self._find(asked, scope["app"].state.context.store)
        if answer is None:
            await self._renew(asked, scope, receive, send)
            return
        scope.update(answer.routed)
        scope[FROM_CACHE] = True
        await answer.representation.response(Request(scope))(scope, receive, send)

    async def _find(self, asked: Asked, store: Store) -> KeptAnswer | None:
        """An answer that shows what is stored now or later; None where a route has to make one."""
        for _ in range(2):  # a renewal at work may have begun before the last change; the one after it has not
            answer = self._answers.get(asked)
            if answer is None or answer.valid(store):
                return answer
            renewal = self._renewals.get(asked)
            if renewal is None:
                return None
            await renewal.wait()
        return self._answers.get(asked)

    async def _renew(self, asked: Asked, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and keep its answer once it begins: a client that reads slowly holds up nobody else."""
        renewal = asyncio.Event()
        if asked in self._answers:
            self._renewals[asked] = renewal

        def finish() -> None:
            if not renewal.is_set():
                self._replace(asked, scope.get(ANSWER))
                self._renewals.pop(asked, None)
                renewal.set()

        async def finish_and_send(message: Message) -> None:
            finish()
            await send(message)

        try:
            await self._app(scope, receive, finish_and_send)
        finally:
            finish()

    def _replace(self, asked: Asked, answer: KeptAnswer | None) -> None:
        old = self._answers.pop(asked, None)
        self._bytes -= old.size if old else 0
        if answer is not None:
            self._answers[asked] = answer
            self._bytes += answer.size
        while self._bytes > MOST_BYTES:
            self._bytes -= self._answers.popitem(last=False)[1].size
