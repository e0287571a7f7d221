"""Converts the seam's records to messages, and carries steps over a socket.

A socket of this machine costs a tenth of a stream of gRPC. Each message is its length, four bytes with the lowest
first, and then its bytes. The socket has a name of Linux's abstract namespace: it leaves no file, and a client in
another network namespace or on another machine cannot connect.
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
from dataclasses import asdict
from typing import Any, NoReturn

import grpc
import numpy as np
from google.protobuf.message import DecodeError

from risk_sac.egos.remote import ego_pb2
from risk_sac.egos.seam import Command, Control, EpisodeStart, Perceived, Trajectory, Vehicle
from risk_sac.world.types import (
    ACCEL,
    HEADING,
    LENGTH,
    OFFSET,
    SPEED,
    VX,
    VY,
    WIDTH,
    Floats,
    Lane,
    Road,
    Signal,
    StopLine,
    X,
    Y,
)

PROTOCOL = 2
SERVICE = "risk_sac.egos.v2.Ego"
METHODS = {  # request and reply
    "Start": (ego_pb2.StartRequest, ego_pb2.StartReply),
    "Act": (ego_pb2.Observation, ego_pb2.Command),  # a stream of each
    "Close": (ego_pb2.CloseRequest, ego_pb2.CloseReply),
}
ROWS = {"x_m": X, "y_m": Y, "heading_rad": HEADING, "vx_mps": VX, "vy_mps": VY, "length_m": LENGTH, "width_m": WIDTH}
PATH = tuple(field.name for field in ego_pb2.Path.DESCRIPTOR.fields)  # in the order of the rows
VEHICLE = tuple(field.name for field in ego_pb2.Vehicle.DESCRIPTOR.fields)


def start_request(episode: EpisodeStart, session: str) -> Any:
    """Returns the StartRequest of an episode."""
    return ego_pb2.StartRequest(
        protocol=PROTOCOL,
        session=session,
        seed=episode.seed,
        net=episode.net,
        route=episode.route,
        step_s=episode.step_s,
        vehicle=asdict(episode.vehicle),
        road={
            "lane": [_lane_fields(lane) for lane in episode.road.lanes],
            "stop_line": [line._asdict() for line in episode.road.stop_lines],
        },
    )


def episode_of(request: Any) -> EpisodeStart:
    """Returns the episode of a StartRequest."""
    return EpisodeStart(
        seed=request.seed,
        net=request.net,
        route=tuple(request.route),
        vehicle=Vehicle(**{name: getattr(request.vehicle, name) for name in VEHICLE}),
        step_s=request.step_s,
        road=Road(
            tuple(_lane_of(lane) for lane in request.road.lane),
            tuple(
                StopLine(**{name: getattr(line, name) for name in StopLine._fields}) for line in request.road.stop_line
            ),
        ),
    )


def _lane_fields(lane: Lane) -> dict[str, Any]:
    fields = lane._asdict()
    fields["x_m"], fields["y_m"] = fields.pop("line").tolist()
    return fields


def _lane_of(message: Any) -> Lane:
    line = np.array((message.x_m, message.y_m))
    plain = {name: getattr(message, name) for name in Lane._fields if name not in ("line", "successors")}
    return Lane(line=line, successors=tuple(message.successors), **plain)


def observation(perceived: Perceived, session: str, new_path: bool) -> Any:
    """Returns the Observation of what the ego perceives."""
    p = perceived
    rows = {name: p.state[row].tolist() for name, row in ROWS.items()}
    return ego_pb2.Observation(
        session=session,
        time_s=p.time_s,
        actors=ego_pb2.Actors(id=p.ids, kind=p.kind.tolist(), **rows),
        path=ego_pb2.Path(**dict(zip(PATH, p.path.tolist(), strict=False))) if new_path else None,
        station_m=p.station_m,
        offset_m=p.offset_m,
        signal=int(p.signal),
        stop_line_m=p.stop_line_m,
        speed_mps=p.state[SPEED, 0],
        accel_mps2=p.state[ACCEL, 0],
        signals=map(int, p.signals),
    )


def perceived_of(message: Any, path: Floats) -> Perceived:
    """Returns what the ego perceives; `path` is the latest one sent."""
    actors = message.actors
    state = np.full((WIDTH + 1, len(actors.id)), np.nan)
    state[[*ROWS.values()], :] = [getattr(actors, name) for name in ROWS]
    state[SPEED] = np.hypot(state[VX], state[VY])
    state[[SPEED, ACCEL, OFFSET], 0] = message.speed_mps, message.accel_mps2, message.offset_m
    return Perceived(
        time_s=message.time_s,
        ids=tuple(actors.id),
        kind=np.array(actors.kind, dtype=np.int8),
        state=state,
        path=path,
        station_m=message.station_m,
        offset_m=message.offset_m,
        signal=Signal(message.signal),
        stop_line_m=message.stop_line_m,
        signals=tuple(map(Signal, message.signals)),
    )


def path_of(message: Any) -> Floats:
    """Returns rows of `risk_sac.egos.driving`, plus the heading's cosine and sine."""
    heading = np.array(message.heading_rad)
    return np.array([*(getattr(message, name) for name in PATH), np.cos(heading), np.sin(heading)])


def command_message(command: Command, time_s: float) -> Any:
    """Returns the Command that answers the observation of a time."""
    if isinstance(command, Control):
        return ego_pb2.Command(control=command._asdict(), time_s=time_s)
    return ego_pb2.Command(trajectory=command._asdict(), time_s=time_s)


def command_of(message: Any) -> Command | None:
    """Returns the ego's command; None if neither control nor trajectory."""
    if message.HasField("control"):
        return Control(message.control.accel_mps2, message.control.steering_rad)
    if message.HasField("trajectory"):
        return Trajectory(*(np.array(getattr(message.trajectory, name)) for name in Trajectory._fields))
    return None


logger = logging.getLogger(__name__)

PREFIX = struct.Struct("<I")
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
        self._connection.sendall(PREFIX.pack(len(message)) + message)

    def receive(self, until: float | None = None) -> bytes:
        """Returns the next message; waits until monotonic time `until` at most.

        Raises:
          TimeoutError: it does not come in time.
          EOFError: the connection ends without one.
          DecodeError: it is too long.
        """
        (length,) = PREFIX.unpack(self._read(PREFIX.size, until))
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
