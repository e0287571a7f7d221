"""Client of an ego in another process."""

import contextlib
import uuid
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any

import grpc
from google.protobuf.message import DecodeError

from risk_sac.egos.guard import CRASH, DEADLINE, MALFORMED
from risk_sac.egos.remote import ego_pb2
from risk_sac.egos.remote.messages import (
    METHODS,
    PROTOCOL,
    SERVICE,
    LocalStream,
    command_of,
    observation,
    start_request,
)
from risk_sac.egos.seam import Command, EpisodeStart, Perceived
from risk_sac.errors import EgoFailed
from risk_sac.host.machine import is_loopback
from risk_sac.world.types import Floats

VERSION = "ego_version"
LONGEST = 1 << 20  # bytes of an answer
OPTIONS = [("grpc.max_receive_message_length", LONGEST), ("grpc.enable_retries", 0)]


class RemoteEgo:
    """Ego in another process: a session per episode, over one connection.

    The connection is renewed when it breaks.
    """

    def __init__(self, name: str, address: str, version: str, deadline_s: float) -> None:
        """Creates the client unconnected: replays fork later, and no connection survives that.

        Args:
          name: of the registered ego; errors name it, and never the address.
          address: of its server.
          version: that the ego has to have.
          deadline_s: for each answer.
        """
        self._name, self._address, self._version, self._deadline_s = name, address, version, deadline_s
        self._channel: Any = None
        self._call: Mapping[str, Any] = {}
        self._session = ""
        self._stream: _Stream | LocalStream | None = None
        self._path: Floats | None = None

    def reset(self, episode: EpisodeStart) -> None:
        """Opens a session.

        Raises:
          EgoFailed: no answer comes in time, or the ego is of another version.
        """
        if self._channel is None:
            proxied = int(not is_loopback(self._address.rpartition(":")[0]))
            options = [*OPTIONS, ("grpc.enable_http_proxy", proxied)]
            self._channel = grpc.insecure_channel(self._address, options=options)
            self._call = {name: self._channel.unary_unary(f"/{SERVICE}/{name}") for name in ("Start", "Close")}
        self._end()
        self._session, self._path = str(uuid.uuid4()), None
        start = start_request(episode, self._session)
        reply = self._asked("Start", start, lambda request: self._call["Start"](request, timeout=self._deadline_s))
        if reply.version != self._version:
            raise EgoFailed(
                f"the ego {self._name!r} is of version {reply.version!r}; registered is {self._version!r}",
                reason=VERSION,
            )
        self._stream = self._steps(reply.socket)

    def _steps(self, socket: str) -> "_Stream | LocalStream":
        """Returns the steps' stream, by the ego's local socket if reachable."""
        if socket:
            with contextlib.suppress(OSError):  # the ego is on another machine
                return LocalStream(socket, self._deadline_s, LONGEST)
        return _Stream(self._channel.stream_stream(f"/{SERVICE}/Act"), self._deadline_s)

    def act(self, perceived: Perceived) -> Command:
        """Sends what is perceived and returns the command.

        Raises:
          EgoFailed: it answers late, with no command, or to another observation.
        """
        assert self._stream is not None
        message = observation(perceived, self._session, new_path=perceived.path is not self._path)
        self._path = perceived.path
        reply = self._asked("Act", message, self._stream.ask)
        if reply.HasField("failure"):
            failure = reply.failure
            reason = MALFORMED if failure.malformed else CRASH
            raise EgoFailed(f"the ego {self._name!r} failed: {failure.text}", reason=reason)
        command = command_of(reply)
        if command is None:
            raise EgoFailed("the ego answered neither a control nor a trajectory", reason=MALFORMED)
        if reply.time_s != message.time_s:
            said = f"an observation of {reply.time_s!r} s; wanted that of {message.time_s!r} s"
            raise EgoFailed(f"the ego {self._name!r} answered {said}", reason=MALFORMED)
        return command

    def close(self) -> None:
        """Ends the session and closes the connection."""
        self._end()
        if self._channel is not None:
            self._channel.close()
            self._channel = None

    def _end(self) -> None:
        if self._stream is not None:
            self._stream.close()
            self._stream = None
        if self._session:
            session, self._session = self._session, ""
            request = ego_pb2.CloseRequest(session=session).SerializeToString()
            self._call["Close"].future(request, timeout=self._deadline_s)  # no need to wait

    def _asked(self, name: str, message: Any, ask: Callable[[bytes], bytes]) -> Any:
        _, reply = METHODS[name]
        try:
            return reply.FromString(ask(message.SerializeToString()))
        except DecodeError as error:
            raise EgoFailed(f"the ego {self._name!r} answered {error}", reason=MALFORMED) from error
        except (StopIteration, EOFError, ConnectionError) as error:
            raise EgoFailed(f"the ego {self._name!r} ended the session unasked", reason=CRASH) from error
        except TimeoutError as error:
            raise self._late() from error
        except grpc.RpcError as error:
            code = error.code()
            if code is grpc.StatusCode.DEADLINE_EXCEEDED:
                raise self._late() from error
            said = f"failed: {code.name}: {error.details()}"
            if code is grpc.StatusCode.UNIMPLEMENTED:
                said = f"does not speak version {PROTOCOL} of the protocol"
            elif code is grpc.StatusCode.UNAVAILABLE:  # whose details name the address
                said = "is not there: nobody answers at the address that it is registered with"
            # What is too long, or what the server itself found malformed.
            malformed = code in (grpc.StatusCode.RESOURCE_EXHAUSTED, grpc.StatusCode.INVALID_ARGUMENT)
            raise EgoFailed(f"the ego {self._name!r} {said}", reason=MALFORMED if malformed else CRASH) from error

    def _late(self) -> EgoFailed:
        return EgoFailed(f"the ego {self._name!r} did not answer within {self._deadline_s:g} s", reason=DEADLINE)


class _Stream:
    """Stream of questions and answers in turn, each with a deadline.

    gRPC has one deadline for a whole stream.
    """

    def __init__(self, method: Callable[[Iterator[bytes]], Any], deadline_s: float) -> None:
        self._deadline_s = deadline_s
        self._questions: SimpleQueue[bytes | None] = SimpleQueue()
        self._answers = method(iter(self._questions.get, None))
        self._reader = ThreadPoolExecutor(1)

    def ask(self, question: bytes) -> bytes:
        """Returns the answer to a question.

        Raises:
          TimeoutError: it does not come in time.
          StopIteration: the stream ends without one.
          grpc.RpcError: the stream breaks.
        """
        self._questions.put(question)
        answer: bytes = self._reader.submit(next, self._answers).result(self._deadline_s)
        return answer

    def close(self) -> None:
        """Ends the stream."""
        self._questions.put(None)
        self._answers.cancel()
        self._reader.shutdown(wait=False)
