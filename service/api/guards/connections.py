"""How many connections there may be, and how long one may keep the server waiting.

A connection costs a descriptor, and the database and the workers need descriptors, too: a server that has none left
stands still. So there is room for so many, and once it is full, the connection that has owed a request for longest
goes, which is none that has just come to send one.
"""

import asyncio
import logging
import os
import resource
import socket
import time
from functools import partial
from http import HTTPStatus
from typing import Any, cast

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

from service.api.answers.problems import ProblemError, problem_response
from service.schemas.problems import Reason
from service.settings import ServiceSettings

OWN_FILES = 64  # that the server may have open without any connection: database, log, keys, reports, uploads
WORKER_FILES = 4  # for each worker
FEWEST = 8
WAITING = 2048  # connections that the kernel keeps until they are accepted
UNREAD_S = 60.0  # for which a client may take nothing of its answer
CALM_S = 60.0  # after which a full room is worth another line in the log

logger = logging.getLogger(__name__)


class Server(uvicorn.Server):
    """Uvicorn's, with room for so many connections and no more."""

    def __init__(self, app: ASGIApp, settings: ServiceSettings, **options: Any) -> None:
        http = cast(type[asyncio.Protocol], partial(Connection, room=Room(settings)))
        super().__init__(uvicorn.Config(app, http=http, backlog=_accepted_at_once(), **options))

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Starts to listen."""
        await super().startup(sockets)
        # The backlog is two things: what the event loop accepts before it looks up, and what waits to be accepted.
        # The second may be large: else, in a rush, newcomers would be passed over and try again only seconds later.
        for listening in (each for server in self.servers for each in server.sockets):
            with socket.socket(fileno=os.dup(listening.fileno())) as same:
                same.listen(WAITING)


def _accepted_at_once() -> int:
    return max(4, min(WAITING, _descriptors() // 32))


def _descriptors() -> int:
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


class Room:
    """The connections of one server."""

    def __init__(self, settings: ServiceSettings) -> None:
        self.head_s = settings.head_timeout_s
        # Of those that go, some still have their descriptor when the next ones are accepted.
        workers = settings.max_workers if settings.executor == "local" else 0
        others = OWN_FILES + WORKER_FILES * workers + 4 * _accepted_at_once()
        possible = max(FEWEST, _descriptors() - others)
        self._most = min(possible, settings.max_connections or possible)
        self._open: set[Connection] = set()
        self._owing: dict[Connection, None] = {}  # those that owe the head of a request, for longest the first
        self._full_at = float("-inf")

    def enter(self, connection: "Connection") -> None:
        """One more, for which another one may have to go."""
        self._open.add(connection)
        self.owe(connection)
        if len(self._open) <= self._most:
            return
        now = time.monotonic()
        if now - self._full_at > CALM_S:
            logger.warning("%d connections are as many as may be; for a new one the longest idle goes", self._most)
        self._full_at = now
        longest = next(iter(self._owing))
        self.leave(longest)
        if longest is connection:  # all others are being answered
            connection.refuse(f"{self._most} connections are open; wanted fewer: try again in 1 s")
        else:
            longest.transport.abort()

    def leave(self, connection: "Connection") -> None:
        """It is gone, or as good as gone."""
        self._open.discard(connection)
        self.settle(connection)

    def owe(self, connection: "Connection") -> None:
        """It is to send the head of a request now."""
        self._owing[connection] = None

    def settle(self, connection: "Connection") -> None:
        """It has sent one."""
        self._owing.pop(connection, None)


class Connection(HttpToolsProtocol):
    """Uvicorn's, with an end to its patience."""

    def __init__(self, *args: Any, room: Room, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._room = room
        self._head_due: asyncio.TimerHandle | None = None
        self._reading_due: asyncio.TimerHandle | None = None
        self._unread = 0  # bytes of answers, when the client was last looked at

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A client has come."""
        super().connection_made(transport)
        self._await_head()
        self._room.enter(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """It has left, or had to."""
        self._room.leave(self)
        for timer in (self._head_due, self._reading_due):
            if timer is not None:
                timer.cancel()
        super().connection_lost(exc)

    def on_headers_complete(self) -> None:
        """The head of a request is here."""
        if self._head_due is not None:
            self._head_due.cancel()
        self._room.settle(self)
        super().on_headers_complete()

    def on_response_complete(self) -> None:
        """An answer is written."""
        super().on_response_complete()
        if self.cycle.response_complete and not self.transport.is_closing():  # it has not sent the next request yet
            self._await_head()
            self._room.owe(self)

    def pause_writing(self) -> None:
        """The client does not read as fast as the answer is written."""
        super().pause_writing()
        self._await_reading()

    def resume_writing(self) -> None:
        """It has caught up."""
        super().resume_writing()
        if self._reading_due is not None:
            self._reading_due.cancel()

    def refuse(self, detail: str) -> None:
        """Say that there is no room."""
        headers = {"Retry-After": "1", "Connection": "close"}
        status = HTTPStatus.SERVICE_UNAVAILABLE
        answer = problem_response("", ProblemError(status, Reason.CONNECTIONS_BUSY, detail, headers=headers))
        lines = [b"%s: %s\r\n" % pair for pair in answer.raw_headers]
        self.transport.write(b"".join([STATUS_LINE[status], *lines, b"\r\n", answer.body]))
        self.transport.close()

    def _await_head(self) -> None:
        # From now on, whatever comes in the meantime: a head that comes byte by byte is late, too.
        self._head_due = self.loop.call_later(self._room.head_s, self._hang_up)

    def _hang_up(self) -> None:
        self.transport.close()  # which first writes what is left of an answer
        self._await_reading()

    def _await_reading(self) -> None:
        self._unread = self.transport.get_write_buffer_size()
        self._reading_due = self.loop.call_later(UNREAD_S, self._look_whether_it_reads)

    def _look_whether_it_reads(self) -> None:
        if self.transport.get_write_buffer_size() < self._unread:
            self._await_reading()
        else:
            self.transport.abort()
