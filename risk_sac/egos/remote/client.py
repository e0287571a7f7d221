"""Our end of the protocol: an ego in another process, as one of ours."""

import uuid
from collections.abc import Callable, Mapping
from typing import Any

import grpc
from google.protobuf.message import DecodeError

from risk_sac.egos.guard import CRASH, DEADLINE, MALFORMED
from risk_sac.egos.remote import ego_pb2
from risk_sac.egos.remote.messages import METHODS, PROTOCOL, SERVICE, command_of, observation, start_request
from risk_sac.egos.remote.turns import Late, Turns
from risk_sac.egos.seam import Command, Episode, Perceived
from risk_sac.errors import EgoFailed
from risk_sac.types import Floats

VERSION = "ego_version"
LONGEST = 1 << 20  # bytes of an answer
OPTIONS = [("grpc.max_receive_message_length", LONGEST), ("grpc.enable_retries", 0)]


class RemoteEgo:
    """A session for each episode, over one connection that is made anew when it breaks."""

    def __init__(self, name: str, address: str, version: str, deadline_s: float) -> None:
        """Connects to nobody yet: replays fork after this, and a connection does not survive that.

        Args:
          name: by which it is registered. What goes wrong is told with it, and never with the address.
          address: of its server.
          version: which it has to say of itself.
          deadline_s: for each answer.
        """
        self._name, self._address, self._version, self._deadline_s = name, address, version, deadline_s
        self._channel: Any = None
        self._call: Mapping[str, Any] = {}
        self._session = ""
        self._turns: Turns | None = None
        self._path: Floats | None = None

    def reset(self, episode: Episode) -> None:
        """Opens a session.

        Raises:
          EgoFailed: nobody answers in time, or an ego of another version.
        """
        if self._channel is None:
            self._channel = grpc.insecure_channel(self._address, options=OPTIONS)
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
        self._turns = Turns(self._channel.stream_stream(f"/{SERVICE}/Act"), self._deadline_s)

    def act(self, perceived: Perceived) -> Command:
        """Tells what is perceived and returns what is commanded.

        Raises:
          EgoFailed: it does not answer in time, or with nothing, or to something else.
        """
        assert self._turns is not None
        message = observation(perceived, self._session, new_path=perceived.path is not self._path)
        self._path = perceived.path
        reply = self._asked("Act", message, self._turns.ask)
        command = command_of(reply)
        if command is None:
            raise EgoFailed("the ego answered neither a control nor a trajectory", reason=MALFORMED)
        if reply.time_s != message.time_s:
            said = f"an observation of {reply.time_s!r} s; wanted that of {message.time_s!r} s"
            raise EgoFailed(f"the ego {self._name!r} answered {said}", reason=MALFORMED)
        return command

    def close(self) -> None:
        """Ends the session and hangs up."""
        self._end()
        if self._channel is not None:
            self._channel.close()
            self._channel = None

    def _end(self) -> None:
        if self._turns is not None:
            self._turns.close()
            self._turns = None
        if self._session:
            session, self._session = self._session, ""
            request = ego_pb2.CloseRequest(session=session).SerializeToString()
            self._call["Close"].future(request, timeout=self._deadline_s)  # nobody waits

    def _asked(self, name: str, message: Any, ask: Callable[[bytes], bytes]) -> Any:
        _, reply = METHODS[name]
        try:
            return reply.FromString(ask(message.SerializeToString()))
        except DecodeError as error:
            raise EgoFailed(f"the ego {self._name!r} answered {error}", reason=MALFORMED) from error
        except StopIteration as error:
            raise EgoFailed(f"the ego {self._name!r} ended the session unasked", reason=CRASH) from error
        except Late as error:
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
            raise EgoFailed(f"the ego {self._name!r} {said}", reason=CRASH) from error

    def _late(self) -> EgoFailed:
        return EgoFailed(f"the ego {self._name!r} did not answer within {self._deadline_s:g} s", reason=DEADLINE)
