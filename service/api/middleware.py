"""Middleware of every request, in pure ASGI because of event streams."""

from fastapi import FastAPI
from prometheus_client import Histogram
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from risk_sac.loopback import is_loopback
from service.api.answer_cache import AnswerCache
from service.api.answers.representations import LEAST_BYTES, takes
from service.api.guards.connections import BodyLimit
from service.api.guards.gate import Gate
from service.api.observe import Observe
from service.keys.made import AuthEnabledFlag
from service.settings import ROOT_PATH, ServiceSettings

GZIP_LEVEL = 4  # of 9; higher levels take several times as long and save a few per cent


def add_middleware(app: FastAPI, settings: ServiceSettings, made: AuthEnabledFlag, latencies: Histogram) -> None:
    """Puts the middleware in place; the last one sees a request first."""
    app.add_middleware(AnswerCache)
    app.add_middleware(Compression, minimum_size=LEAST_BYTES, compresslevel=GZIP_LEVEL)
    app.add_middleware(BodyLimit, settings=settings)
    app.add_middleware(Gate, settings=settings, made=made)
    if settings.cors_origins:  # keys travel in a header, never in cookies, so credentials are not allowed
        app.add_middleware(
            Cors,
            allow_origins=settings.cors_origins,
            allow_methods=("GET", "POST", "PUT", "DELETE"),
            allow_headers=("Authorization", "Content-Type", "Idempotency-Key", "If-None-Match", "Last-Event-ID"),
            expose_headers=("ETag", "Location", "Retry-After"),
        )
    app.add_middleware(SecurityHeaders)
    app.add_middleware(Head)
    app.add_middleware(Observe, latencies=latencies)
    app.add_middleware(ForwardedPrefix)


class Compression(GZipMiddleware):
    """Starlette's gzip middleware that also honours `gzip;q=0` and sets Vary.

    It skips pictures, files and event streams. ETags are made weak, so they hold for both forms.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forwards the request and compresses the answer."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_with_vary(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(raw=message["headers"])
                if "etag" in headers and "Accept-Encoding" not in headers.get("vary", ""):  # a 304, too
                    headers.add_vary_header("Accept-Encoding")
                if headers.get("content-encoding") == "gzip" and headers.get("etag", "W/")[:2] != "W/":
                    headers["etag"] = f"W/{headers['etag']}"  # a file's own tag is that of its bytes
            await send(message)

        packs = takes(", ".join(Headers(scope=scope).getlist("accept-encoding")), "gzip")
        others = [each for each in scope["headers"] if each[0] != b"accept-encoding"]
        scope["headers"] = [*others, (b"accept-encoding", b"gzip")] if packs else others
        await super().__call__(scope, receive, send_with_vary)


class Cors(CORSMiddleware):
    """Starlette's CORS middleware, with preflight answers without a body."""

    def preflight_response(self, request_headers: Headers) -> Response:
        """Answers a browser's preflight request."""
        answer = super().preflight_response(request_headers)
        status = 204 if answer.status_code == 200 else 403
        named = {name: value for name, value in answer.headers.items() if not name.startswith("content-")}
        return Response(status_code=status, headers=named)


class SecurityHeaders:
    """ASGI middleware: forbids type sniffing, and caching by default."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forwards the request and adds headers to the answer."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["x-content-type-options"] = "nosniff"
                headers.setdefault("cache-control", "no-store")
            await send(message)

        await self._app(scope, receive, send_with_headers)


class ForwardedPrefix:
    """ASGI middleware: links begin with the prefix that a local proxy stripped.

    The header is trusted, because only the links of its own answer depend on it.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forwards the request with the prefix as root path, unless the settings have one."""
        if scope["type"] == "http" and not scope.get("root_path") and is_loopback((scope.get("client") or [""])[0]):
            prefix = Headers(scope=scope).get("x-forwarded-prefix", "").rstrip("/")
            if prefix and ROOT_PATH.fullmatch(prefix):
                scope.update(root_path=prefix, path=prefix + scope["path"])
        await self._app(scope, receive, send)


class Head:
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
