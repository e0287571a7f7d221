"""An episode's steps over a socket of this machine, which costs a tenth of a stream of gRPC.

Each message is its length, four bytes with the lowest first, and then its bytes. The socket has a name of Linux's
abstract namespace: it leaves no file, and a client in another network namespace or on another machine cannot connect.
"""

import contextlib
import logging
import socket
import struct
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

import grpc
from google.protobuf.message import DecodeError

from risk_sac.egos.remote import ego_pb2

logger = logging.getLogger(__name__)

LENGTH = struct.Struct("<I")
LONGEST = 1 << 22  # bytes of an observation
BACKLOG = 64
Serve = Callable[[Iterator[Any], Any], Iterator[Any]]  # observations and a context to commands, as for gRPC's Act


class Framed:
    """A connection that carries one message after the other."""

    def __init__(self, connection: socket.socket, longest: int) -> None:
        """Takes messages of at most `longest` bytes."""
        self._connection, self._longest = connection, longest
        self._unread = b""

    def send(self, message: bytes) -> None:
        """Sends a message; raises OSError if the connection is broken."""
        self._connection.sendall(LENGTH.pack(len(message)) + message)

    def receive(self, until: float | None = None) -> bytes:
        """Returns the next message; `until` is the latest monotonic time to wait for it.

        Raises:
          TimeoutError: it does not come in time.
          EOFError: the connection ends without one.
          DecodeError: it is too long.
        """
        (length,) = LENGTH.unpack(self._read(LENGTH.size, until))
        if length > self._longest:
            raise DecodeError(f"a message of {length} bytes, larger than max {self._longest}")
        return self._read(length, until)

    def close(self) -> None:
        """Closes the connection."""
        self._connection.close()

    def _read(self, count: int, until: float | None) -> bytes:
        while len(self._unread) < count:
            if until is not None:
                self._connection.settimeout(max(until - time.monotonic(), 1e-6))
            more = self._connection.recv(1 << 16)
            if not more:
                raise EOFError
            self._unread += more
        read, self._unread = self._unread[:count], self._unread[count:]
        return read


class LocalStream:
    """Client's end: questions and answers in turn, each with a deadline."""

    def __init__(self, name: str, deadline_s: float, longest: int) -> None:
        """Connects; raises OSError if nothing listens under this name here.

        Args:
          name: of the ego's socket.
          deadline_s: for each answer.
          longest: bytes of an answer.
        """
        self._deadline_s = deadline_s
        connection = socket.socket(socket.AF_UNIX)
        try:
            connection.settimeout(deadline_s)
            connection.connect(f"\0{name}")
        except BaseException:
            connection.close()
            raise
        self._connection = connection
        self._framed = Framed(connection, longest)

    def ask(self, question: bytes) -> bytes:
        """Returns the answer to a question; see `Framed.receive` for what it raises."""
        until = time.monotonic() + self._deadline_s
        self._connection.settimeout(self._deadline_s)
        with contextlib.suppress(ConnectionError):  # the ego has left, but may have said why
            self._framed.send(question)
        return self._framed.receive(until)

    def close(self) -> None:
        """Ends the stream."""
        self._framed.close()


class RefusedStep(Exception):
    """The ego refused an observation; as gRPC's abort."""


class StepContext:
    """Stands for gRPC's context where there is none."""

    def abort(self, code: grpc.StatusCode, details: str) -> NoReturn:
        """Ends the stream with an error."""
        raise RefusedStep(code, details)


def listen(serve: Serve) -> str:
    """Answers steps of sessions in threads; returns the socket's name, or ""."""
    if sys.platform != "linux":
        return ""
    name = f"risk-sac-ego-{uuid.uuid4()}"
    server = socket.socket(socket.AF_UNIX)
    server.bind(f"\0{name}")
    server.listen(BACKLOG)
    threading.Thread(target=_accept, args=(server, serve), name="local steps", daemon=True).start()
    return name


def _accept(server: socket.socket, serve: Serve) -> None:
    while True:
        connection, _ = server.accept()
        threading.Thread(target=_answer, args=(Framed(connection, LONGEST), serve), name="session", daemon=True).start()


def _answer(framed: Framed, serve: Serve) -> None:
    try:
        for command in serve(_observations(framed), StepContext()):
            framed.send(command.SerializeToString())
    except OSError:  # the client is gone
        pass
    except RefusedStep as refused:
        code, details = refused.args
        _tell(framed, details, malformed=code is grpc.StatusCode.INVALID_ARGUMENT)
    except Exception as error:
        logger.exception("a session ended")
        _tell(framed, f"{type(error).__name__}: {error}", malformed=False)
    finally:
        framed.close()


def _tell(framed: Framed, text: str, *, malformed: bool) -> None:
    with contextlib.suppress(OSError):
        framed.send(ego_pb2.Command(failure={"text": text, "malformed": malformed}).SerializeToString())


def _observations(framed: Framed) -> Iterator[Any]:
    with contextlib.suppress(EOFError, ConnectionError):
        while True:
            yield ego_pb2.Observation.FromString(framed.receive())
