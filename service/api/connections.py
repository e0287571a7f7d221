"""Guards against slow clients: idle connections, slow heads and bodies, unread answers.

A connection costs a descriptor, which database and workers need too. So the number of connections is bounded. A new one
replaces the connection that has owed a request head for longest, or else one whose client does not read its answer.
"""

import asyncio
import logging
import resource
import socket
import time
from functools import partial
from http import HTTPStatus
from typing import Any, cast

import h11
import uvicorn
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.flow_control import CLOSE_HEADER
from uvicorn.protocols.http.h11_impl import H11Protocol

from service.api.problems import ProblemError, Reason, problem_response, route_path
from service.settings import ServiceSettings

OWN_FILES = 64  # that the server may have open without any connection: database, log, keys, reports, uploads
WORKER_FILES = 4  # for each worker
FEWEST = 8
BACKLOG = 2048  # connections that the kernel queues until they are accepted
STUCK_S = 1.0  # after which a client that takes nothing of its answer may lose its place to another one
UNREAD_S = 60.0  # for which a client may take nothing of its answer
MOST_HEAD_BYTES = 1 << 16  # of a head, and of a chunk's first line and the trailers of a body
PIECE_BYTES = 1 << 13  # that h11 reads at once
CALM_S = 60.0  # between two log lines about a full room
UPLOADS = ("/v1/networks", "/v1/scenarios")

logger = logging.getLogger(__name__)


class Server(uvicorn.Server):
    """Uvicorn's server with a bounded number of connections."""

    def __init__(self, app: ASGIApp, settings: ServiceSettings, **options: Any) -> None:
        room = Room(settings)
        http = cast(type[asyncio.Protocol], partial(Connection, room=room))
        options |= {"backlog": room.accepted_at_once, "root_path": settings.root_path}
        options |= {"proxy_headers": bool(settings.trusted_proxies), "forwarded_allow_ips": settings.trusted_proxies}
        super().__init__(uvicorn.Config(app, http=http, h11_max_incomplete_event_size=MOST_HEAD_BYTES, **options))

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Starts to listen, with a long queue of connections not yet accepted."""
        await super().startup(sockets)
        # asyncio also takes the backlog as the number of connections that it accepts in one turn, which must be small.
        for listening in (each for server in self.servers for each in server.sockets):
            with listening.dup() as same:
                same.listen(BACKLOG)
        for address in page_addresses(self):
            logger.info("the page is at %s", address)


def page_addresses(server: uvicorn.Server) -> list[str]:
    """Returns the page's addresses; loopback stands for a server on all addresses."""
    bound = [each.getsockname()[:2] for listening in server.servers for each in listening.sockets]
    named = [("127.0.0.1" if host in ("0.0.0.0", "::") else host, port) for host, port in bound]
    path = f"{server.config.root_path}/page/"
    return list(dict.fromkeys(f"http://{f'[{host}]' if ':' in host else host}:{port}{path}" for host, port in named))


class Room:
    """The connections of one server."""

    def __init__(self, settings: ServiceSettings) -> None:
        self.head_s = settings.head_timeout_s
        self.owing: dict[Connection, None] = {}  # those that owe a request head, longest first
        self.unread: dict[Connection, float] = {}  # those whose client takes nothing, by when that began, longest first
        self.accepted_at_once = _accepted_at_once()
        self._most = most_connections(settings)
        self._full_at = float("-inf")

    def enter(self, connection: "Connection") -> None:
        """Makes room for a new connection by dropping the longest idle one."""
        if len(connection.connections) <= self._most:  # of the server, as uvicorn counts them
            return
        now = time.monotonic()
        if now - self._full_at > CALM_S:
            logger.warning("%d connections are as many as may be; for a new one the longest idle goes", self._most)
        self._full_at = now
        longest = next(iter(self.owing))
        if longest is connection:  # all others are being answered
            longest = next((each for each, since in self.unread.items() if now - since > STUCK_S), connection)
        self.leave(longest)
        if longest is connection:
            detail = f"{self._most} connections are open; wanted fewer: try again in 1 s"
            connection.refuse(ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.CONNECTIONS_BUSY, detail, retry_s=1))
        else:
            longest.transport.abort()

    def leave(self, connection: "Connection") -> None:
        """Forgets a connection."""
        self.owing.pop(connection, None)
        self.unread.pop(connection, None)


def most_connections(settings: ServiceSettings) -> int:
    """Returns the number of connections that descriptors and settings allow."""
    descriptors = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    workers = settings.max_workers if settings.executor == "local" else 0
    # Closed connections may still hold their descriptors when the next ones are accepted.
    possible = max(FEWEST, descriptors - OWN_FILES - WORKER_FILES * workers - 4 * _accepted_at_once())
    return min(possible, settings.max_connections or possible)


def _accepted_at_once() -> int:
    return max(4, min(BACKLOG, resource.getrlimit(resource.RLIMIT_NOFILE)[0] // 32))


class Connection(H11Protocol):
    """Uvicorn's HTTP protocol with deadlines for request heads and reading answers."""

    def __init__(self, *args: Any, room: Room, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._room = room
        self._head_due: asyncio.TimerHandle | None = None
        self._reading_due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Expects a request head, as uvicorn calls it."""
        super().connection_made(transport)
        self._await_head()
        self._room.enter(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancels the deadlines."""
        self._room.leave(self)
        for timer in filter(None, (self._head_due, self._reading_due)):
            timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Reads in pieces: h11 limits a head's size only while incomplete."""
        for first in range(0, len(data), PIECE_BYTES):
            if not self.transport.is_closing():
                super().data_received(data[first : first + PIECE_BYTES])

    def handle_events(self) -> None:
        """Begins the answer once the head is complete."""
        super().handle_events()
        if self._head_due is not None and self.cycle is not None and not self.cycle.response_complete:
            self._head_due.cancel()
            self._room.owing.pop(self, None)

    def on_response_complete(self) -> None:
        """Expects the next request head, which may have come already."""
        if not self.transport.is_closing():
            self._await_head()
        super().on_response_complete()

    def pause_writing(self) -> None:
        """Sets a deadline for a client that reads too slowly."""
        super().pause_writing()
        self._room.unread[self] = time.monotonic()
        self._await_reading()

    def resume_writing(self) -> None:
        """Cancels that deadline."""
        super().resume_writing()
        self._room.unread.pop(self, None)
        if self._reading_due is not None:
            self._reading_due.cancel()

    def send_400_response(self, msg: str) -> None:
        """Answers what h11 refuses to read, as uvicorn calls it."""
        unread, _ = self.conn.trailing_data
        if len(unread) > MOST_HEAD_BYTES:
            status, reason = HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, Reason.TOO_LARGE
            detail = f"the head of the request is larger than {MOST_HEAD_BYTES} bytes; wanted fewer or shorter headers"
        else:
            status, reason = HTTPStatus.BAD_REQUEST, Reason.MALFORMED_HTTP
            detail = "the request is no valid HTTP/1.1; wanted a request line and headers, exactly one Host among them"
        self.refuse(ProblemError(status, reason, detail))

    def refuse(self, problem: ProblemError) -> None:
        """Answers with a problem, unless an answer has begun, and closes."""
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            answer = problem_response("", problem)
            headers = [*answer.raw_headers, CLOSE_HEADER]
            head = h11.Response(status_code=problem.status, headers=headers, reason=problem.status.phrase.encode())
            for event in (head, h11.Data(data=bytes(answer.body)), h11.EndOfMessage()):
                self.transport.write(self.conn.send(event) or b"")
        self.transport.close()

    def _await_head(self) -> None:
        self._room.owing[self] = None
        self._head_due = self.loop.call_later(self._room.head_s, self._hang_up)  # also if it comes byte by byte

    def _hang_up(self) -> None:
        self.transport.close()  # which first writes the rest of an answer
        self._await_reading()

    def _await_reading(self) -> None:
        unread = self.transport.get_write_buffer_size()
        self._reading_due = self.loop.call_later(UNREAD_S, self._check_reading, unread)

    def _check_reading(self, unread: int) -> None:
        if self.transport.get_write_buffer_size() < unread:
            self._await_reading()
        else:
            self.transport.abort()


class BodyLimit:
    """ASGI middleware that refuses bodies too large or too slow."""

    def __init__(self, app: ASGIApp, settings: ServiceSettings) -> None:
        self._app = app
        self._settings = settings

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes on; reading a refused body raises an error, which is answered."""
        headers = dict(scope["headers"]) if scope["type"] == "http" else {}
        if b"content-length" not in headers and b"transfer-encoding" not in headers:
            await self._app(scope, receive, send)
            return
        settings = self._settings
        limit = settings.max_upload_bytes if route_path(scope).startswith(UPLOADS) else settings.max_body_bytes
        if int(headers.get(b"content-length", 0)) > limit:  # uvicorn has checked that it is a number
            await problem_response(scope["path"], _too_large(limit))(scope, receive, send)
            return
        received, waited_s, complete = 0, 0.0, False

        async def limited_receive() -> Message:
            nonlocal received, waited_s, complete
            if complete:  # what is waited for now is that the client leaves
                return await receive()
            began = time.monotonic()
            try:
                async with asyncio.timeout(settings.body_patience_s + received / settings.min_body_rate - waited_s):
                    message = await receive()
            except TimeoutError as error:
                slow = f"{settings.min_body_rate} bytes per second, for more than {settings.body_patience_s:g} s"
                detail, status = f"the body comes more slowly than {slow}; wanted it faster", HTTPStatus.REQUEST_TIMEOUT
                raise ProblemError(status, Reason.UPLOAD_TOO_SLOW, detail, headers={"Connection": "close"}) from error
            waited_s += time.monotonic() - began  # without the time that the service takes itself
            received += len(message.get("body", b""))
            complete = not message.get("more_body", False)
            if received > limit:
                raise _too_large(limit)
            return message

        await self._app(scope, limited_receive, send)


def _too_large(limit: int) -> ProblemError:
    detail = f"the body is larger than {limit} bytes; wanted a smaller one"
    return ProblemError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, Reason.TOO_LARGE, detail)
