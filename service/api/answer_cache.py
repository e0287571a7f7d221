"""Caches answers per project until the revision that they show changes.

The cache comes before the router, because routing costs several times as much as a cached answer.
"""

import asyncio
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fastapi import Request, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.context import CALLER
from service.api.pages import has
from service.store.reading import Store

MOST_BYTES = 16 << 20  # of all kept answers
OVERHEAD_BYTES = 2000  # of each answer, about, beside its body, path and query
ANSWER = "risk_sac.answer"  # in the ASGI scope: what a route wants to have kept
FROM_CACHE = "risk_sac.from_cache"  # in the ASGI scope: set where a kept answer was given

Asked = tuple[str | None, str, bytes]  # the only project that the caller sees (None: all), path and query


@dataclass(frozen=True, slots=True)
class KeptAnswer:
    """An answer with the revision that makes it valid."""

    body: bytes
    headers: Mapping[str, str]  # with a tag
    revision: str  # read before the body was made, so that it is never newer
    campaign_id: str | None  # whose revision it is; None: the one of all campaigns together
    routed: Mapping[str, Any]  # what the router leaves in the scope for the log and the metrics
    media_type: str

    def valid(self, store: Store) -> bool:
        """Whether nothing has changed since."""
        campaign_id = self.campaign_id
        return self.revision == (store.revision_of_all() if campaign_id is None else store.known_revision(campaign_id))

    def response(self, request: Request) -> Response:
        """The body, or 304 where the client has it."""
        if has(request, self.headers["ETag"]):
            return Response(status_code=304, headers=self.headers)
        return Response(self.body, headers=self.headers, media_type=self.media_type)


def kept(
    request: Request,
    body: bytes,
    headers: Mapping[str, str],
    revision: str,
    campaign_id: str | None = None,
    *,
    media_type: str = "application/json",
) -> Response:
    """An answer that the cache gives again; see `KeptAnswer`.

    It may depend on the project that the caller sees, the path and the query alone.
    """
    routed = {name: request.scope[name] for name in ("route", "path_params")}
    answer = KeptAnswer(body, headers, revision, campaign_id, routed, media_type)
    request.scope[ANSWER] = answer
    return answer.response(request)


class AnswerCache:
    """ASGI middleware behind the guards: callers are authorised already."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._answers: OrderedDict[Asked, tuple[int, KeptAnswer]] = OrderedDict()  # by when they were made
        self._renewals: dict[Asked, asyncio.Event] = {}  # set once a new answer is there, or is known to fail
        self._passed_on = 0  # requests; each answer goes with the number of the request that it was made for
        self._bytes = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Sends the cached answer while it is valid, else calls the route."""
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
        await answer.response(Request(scope))(scope, receive, send)

    async def _find(self, asked: Asked, store: Store) -> KeptAnswer | None:
        """Returns a current answer; None if a route has to make one."""
        before = self._passed_on
        while asked in self._answers:
            number, answer = self._answers[asked]
            if number > before or answer.valid(store):
                return answer
            if asked not in self._renewals:
                return None
            await self._renewals[asked].wait()  # it may have begun before the last change; the one after it has not
        return None

    async def _renew(self, asked: Asked, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on and caches its answer once it begins."""
        self._passed_on += 1
        number, renewal = self._passed_on, asyncio.Event()
        if asked in self._answers:
            self._renewals[asked] = renewal

        def finish() -> None:
            if not renewal.is_set():
                renewal.set()
                self._renewals.pop(asked, None)
                self._replace(asked, number, scope.get(ANSWER))

        async def finish_and_send(message: Message) -> None:
            finish()
            await send(message)

        try:
            await self._app(scope, receive, finish_and_send)
        finally:
            finish()

    def _replace(self, asked: Asked, number: int, answer: KeptAnswer | None) -> None:
        """Replaces a cached answer, or removes it for None; evicts the oldest."""
        if asked in self._answers:
            self._bytes -= _size(asked, self._answers.pop(asked)[1])
        if answer is not None and _size(asked, answer) <= MOST_BYTES // 2:  # else all others would make room for it
            self._answers[asked] = number, answer
            self._bytes += _size(asked, answer)
        while self._bytes > MOST_BYTES:
            oldest, (_, kept) = self._answers.popitem(last=False)
            self._bytes -= _size(oldest, kept)


def _size(asked: Asked, answer: KeptAnswer) -> int:
    """Memory that an answer takes, bytes, about."""
    _, path, query = asked
    return len(answer.body) + len(path) + len(query) + OVERHEAD_BYTES
