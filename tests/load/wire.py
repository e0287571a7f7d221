"""As little HTTP/1.1 as a load generator needs, on connections to this machine, so that it costs the machine little.

A client library would cost several times what the service itself does per answer.
"""

import asyncio
import re
from collections.abc import Callable
from dataclasses import dataclass

HOST = "127.0.0.1"  # and nowhere else: this is a load generator
HEAD_END = b"\r\n\r\n"
_LENGTH = re.compile(rb"\r\ncontent-length: *(\d+)", re.IGNORECASE)
_TAG = re.compile(rb"\r\netag: *([^\r]+)", re.IGNORECASE)
_CHUNKED = re.compile(rb"\r\ntransfer-encoding: *chunked", re.IGNORECASE)


class WireError(Exception):
    """The connection broke, or what came is no HTTP that is understood here."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a poll needs to know of an answer."""

    status: int
    tag: bytes | None
    body: bytes


def get(port: int, path: str, *headers: str) -> bytes:
    """A request as it is sent."""
    lines = [f"GET {path} HTTP/1.1", f"Host: {HOST}:{port}", *headers]
    return "\r\n".join(lines).encode() + HEAD_END


class Polling(asyncio.Protocol):
    """A connection that is kept, with one request at a time."""

    def __init__(self) -> None:
        self._received = b""
        self._answer: asyncio.Future[Answer] | None = None
        self._transport: asyncio.Transport | None = None

    @classmethod
    async def open(cls, port: int) -> "Polling":
        """A new connection."""
        return (await asyncio.get_running_loop().create_connection(cls, HOST, port))[1]

    def ask(self, request: bytes) -> "asyncio.Future[Answer]":
        """Sends a request; the answer fails with a WireError if the connection does."""
        self._answer = asyncio.get_running_loop().create_future()
        if self._transport is None or self._transport.is_closing():
            self._answer.set_exception(WireError("connection closed between requests"))
        else:
            self._transport.write(request)
        return self._answer

    def close(self) -> None:
        """Hang up."""
        if self._transport is not None:
            self._transport.close()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """asyncio's: it is open."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        """asyncio's: some of an answer."""
        self._received += data
        head_end = self._received.find(HEAD_END)
        if head_end < 0 or self._answer is None or self._answer.done():
            return
        head = self._received[:head_end]
        length = _LENGTH.search(head)
        end = head_end + len(HEAD_END) + (int(length[1]) if length else 0)
        if len(self._received) < end:
            return
        tag = _TAG.search(head)
        body = self._received[head_end + len(HEAD_END) : end]
        self._received = self._received[end:]
        self._answer.set_result(Answer(int(head[9:12]), tag[1] if tag else None, body))

    def connection_lost(self, exc: Exception | None) -> None:
        """asyncio's: it is closed."""
        if self._answer is not None and not self._answer.done():
            self._answer.set_exception(WireError("connection closed before the answer"))


class Streaming(asyncio.Protocol):
    """A connection with one chunked answer, cut into the blocks that blank lines end.

    Attributes:
      over: resolves once the answer has ended in order, to its status; fails if it does not.
    """

    def __init__(self, request: bytes, told: Callable[[bytes], None]) -> None:
        self._request = request
        self._told = told
        self._received = bytearray()
        self._text = b""
        self._status: int | None = None
        self._transport: asyncio.Transport | None = None
        self.over: asyncio.Future[int] = asyncio.get_running_loop().create_future()

    def close(self) -> None:
        """Hang up, as a client does whose connection breaks."""
        self.over.cancel()
        if self._transport is not None:
            self._transport.close()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """asyncio's: it is open."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        transport.write(self._request)

    def data_received(self, data: bytes) -> None:
        """asyncio's: some of the answer."""
        self._received += data
        try:
            if self._status is None and not self._read_head():
                return
            while (chunk := self._next_chunk()) is not None:
                self._read(chunk)
        except ValueError as error:
            self._fail(str(error))

    def connection_lost(self, exc: Exception | None) -> None:
        """asyncio's: it is closed."""
        self._fail("connection closed within the stream")

    def _read_head(self) -> bool:
        """Whether the head is complete."""
        end = self._received.find(HEAD_END)
        if end < 0:
            return False
        head = bytes(self._received[:end])
        del self._received[: end + len(HEAD_END)]
        self._status = int(head[9:12])
        if _CHUNKED.search(head) is None:
            self._end()
        return True

    def _next_chunk(self) -> bytes | None:
        """The next chunk, if it is complete."""
        size_end = self._received.find(b"\r\n")
        if size_end < 0:
            return None
        begin = size_end + 2
        end = begin + int(self._received[:size_end], 16)
        if len(self._received) < end + 2:
            return None
        chunk = bytes(self._received[begin:end])
        del self._received[: end + 2]
        return chunk

    def _read(self, chunk: bytes) -> None:
        if not chunk:
            self._end()
            return
        *blocks, self._text = (self._text + chunk).split(b"\n\n")
        for block in blocks:
            self._told(block)

    def _end(self) -> None:
        assert self._status is not None
        if not self.over.done():
            self.over.set_result(self._status)
        if self._transport is not None:
            self._transport.close()

    def _fail(self, why: str) -> None:
        if not self.over.done():
            self.over.set_exception(WireError(why))
        if self._transport is not None:
            self._transport.close()
