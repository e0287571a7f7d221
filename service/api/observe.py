"""Records every request: duration, log line and request id."""

import logging
import random
import re
import time

from prometheus_client import Histogram
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.answer_cache import FROM_CACHE
from service.api.context import CALLER, Caller

logger = logging.getLogger("service.access")

REQUEST_ID = b"x-request-id"
_SANE = re.compile(rb"[\x21-\x7e]{1,100}")
_UNKNOWN = "unknown"  # one label for all paths that no route answers, or anybody could make thousands
_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


class Observe:
    """ASGI middleware, outermost, so that refused requests count as well."""

    def __init__(self, app: ASGIApp, latencies: Histogram) -> None:
        self._app = app
        self._latencies = latencies

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes on and records when the answer begins and ends."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        began = time.perf_counter()
        request_id = _request_id(scope)
        status = 0

        async def note(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*message.get("headers", ()), (REQUEST_ID, request_id)]
                self._observe(scope, status, time.perf_counter() - began)
            await send(message)

        try:
            await self._app(scope, receive, note)
        finally:
            if not status:  # an exception on its way to the handler of last resort
                status = 500
                self._observe(scope, status, time.perf_counter() - began)
            _log(scope, status, time.perf_counter() - began, request_id.decode())

    def _observe(self, scope: Scope, status: int, seconds: float) -> None:
        method = scope["method"] if scope["method"] in _METHODS else _UNKNOWN
        self._latencies.labels(_route(scope), method, str(status)).observe(seconds)


def _route(scope: Scope) -> str:
    """The template of the route that answers, which the router leaves behind."""
    return getattr(scope.get("route"), "path", _UNKNOWN)


def _request_id(scope: Scope) -> bytes:
    given = next((value for name, value in scope["headers"] if name == REQUEST_ID), b"")
    return given if _SANE.fullmatch(given) else b"%016x" % random.getrandbits(64)


def _log(scope: Scope, status: int, seconds: float, request_id: str) -> None:
    # Clients that poll would fill the disk, so answers from the cache are not logged by default.
    level = logging.DEBUG if FROM_CACHE in scope else logging.INFO
    if not logger.isEnabledFor(level):
        return
    ms = round(1e3 * seconds, 2)
    fields = {"method": scope["method"], "route": _route(scope), "status": status, "ms": ms, "request_id": request_id}
    campaign = scope.get("path_params", {}).get("campaign_id", "")
    if campaign.isascii() and campaign.isalnum():  # as all ids are; what else was asked for is not for the log
        fields["campaign"] = campaign
    caller: Caller | None = scope.get(CALLER)
    if caller is not None:
        fields |= {"project": caller.project, "key": caller.key_id}
    logger.log(level, "%s %s %d %.2f ms", scope["method"], fields["route"], status, ms, extra=fields)
