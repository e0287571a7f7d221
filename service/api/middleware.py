"""Middleware: records requests, adds headers, compresses, and answers HEAD."""

import logging
import random
import re
import time

from fastapi import FastAPI
from prometheus_client import Histogram
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.answer_cache import FROM_CACHE, AnswerCache
from service.api.connections import BodyLimit
from service.api.context import CALLER, Caller
from service.api.gate import Gate
from service.settings import ServiceSettings

logger = logging.getLogger("service.access")

_SANE = re.compile(r"[\x21-\x7e]{1,100}")
_UNKNOWN = "unknown"  # one label for all paths that no route answers, or anybody could make thousands
_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


class Observe:
    """Outermost ASGI middleware: counts, logs, and adds headers, for refused requests too."""

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
                headers = MutableHeaders(scope=message)
                headers["x-request-id"] = request_id
                headers["x-content-type-options"] = "nosniff"
                headers.setdefault("cache-control", "no-cache" if "etag" in headers else "no-store")
                self._observe(scope, status, time.perf_counter() - began)
            await send(message)

        try:
            await self._app(scope, receive, note)
        finally:
            if not status:  # an exception on its way to the handler of last resort
                status = 500
                self._observe(scope, status, time.perf_counter() - began)
            _log(scope, status, time.perf_counter() - began, request_id)

    def _observe(self, scope: Scope, status: int, seconds: float) -> None:
        method = scope["method"] if scope["method"] in _METHODS else _UNKNOWN
        self._latencies.labels(_route(scope), method, str(status)).observe(seconds)


def _route(scope: Scope) -> str:
    """The template of the route that answers, which the router leaves behind."""
    return getattr(scope.get("route"), "path", _UNKNOWN)


def _request_id(scope: Scope) -> str:
    given = Headers(scope=scope).get("x-request-id", "")
    return given if _SANE.fullmatch(given) else f"{random.getrandbits(64):016x}"


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


LEAST_BYTES = 2000  # of what is compressed
GZIP_LEVEL = 4  # of 9; higher levels take several times as long and save a few per cent


def add_middleware(app: FastAPI, settings: ServiceSettings, latencies: Histogram) -> None:
    """Puts the middleware in place; the last one sees a request first."""
    app.add_middleware(AnswerCache)
    app.add_middleware(GZipMiddleware, minimum_size=LEAST_BYTES, compresslevel=GZIP_LEVEL)
    app.add_middleware(BodyLimit, settings=settings)
    app.add_middleware(Gate, settings=settings)
    if settings.cors_origins:  # keys travel in a header, never in cookies, so credentials are not allowed
        app.add_middleware(
            CORSMiddleware,
            allow_origins=settings.cors_origins,
            allow_methods=("GET", "POST", "PUT", "DELETE"),
            allow_headers=("Authorization", "Content-Type", "Idempotency-Key", "If-None-Match", "Last-Event-ID"),
            expose_headers=("ETag", "Location", "Retry-After"),
        )
    app.add_middleware(HeadRequests)
    app.add_middleware(Observe, latencies=latencies)


class HeadRequests:
    """ASGI middleware that answers HEAD like GET, without the body.

    A stream would not end by itself, so the app sees a disconnected client.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forwards the request as GET and ends the answer before its body."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self._app(scope, receive, send)
            return
        asked, answered = {**scope, "method": "GET"}, False

        async def receive_until_answered() -> Message:
            return {"type": "http.disconnect"} if answered else await receive()

        async def send_head(message: Message) -> None:
            nonlocal answered
            if answered:
                return
            answered = message["type"] == "http.response.start"
            scope.update(asked | {"method": "HEAD"})  # the router and the gate store in it what the log needs
            await send(message)
            if answered:
                await send({"type": "http.response.body"})

        await self._app(asked, receive_until_answered, send_head)
