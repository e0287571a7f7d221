"""Session with a remote ego: late, disordered or lost answers never count."""

import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any

import grpc
import numpy as np
import pytest

from risk_sac.egos import Control, EpisodeStart, Perceived, Trajectory
from risk_sac.egos.remote.client import RemoteEgo
from risk_sac.egos.remote.ego_pb2 import CloseReply, Command, Observation, StartReply
from risk_sac.egos.remote.messages import METHODS, SERVICE, command_message, listen
from risk_sac.egos.seam import Vehicle
from risk_sac.egos.serve import Sessions, serve
from risk_sac.errors import EgoFailed
from risk_sac.world.types import WIDTH, Signal
from tests.server import ROOT

EPISODE = EpisodeStart(seed=0, net="", route=("a",), vehicle=Vehicle(length_m=4.6, width_m=1.85), step_s=0.1)
PATIENT_S = 60.0
Acts = Callable[[Iterator[Observation]], Iterator[Command]]


def perceived(time_s: float) -> Perceived:
    kind, state, path = np.zeros(1, dtype=np.int8), np.zeros((WIDTH + 1, 1)), np.zeros((7, 2))
    return Perceived(time_s, ("ego",), kind, state, path, 1.0, 0.0, Signal.NONE, np.inf)


@contextmanager
def session(acts: Acts, deadline_s: float, socket: str) -> Iterator[RemoteEgo]:
    """A session with a server that answers observations so."""
    kinds = {"Start": grpc.unary_unary_rpc_method_handler, "Close": grpc.unary_unary_rpc_method_handler}
    kinds["Act"] = grpc.stream_stream_rpc_method_handler
    answers = {
        "Start": lambda *_: StartReply(version="1", socket=socket),
        "Act": lambda requests, _: acts(requests),
        "Close": lambda *_: CloseReply(),
    }
    handlers = {
        name: kinds[name](answers[name], request.FromString, lambda reply: reply.SerializeToString())
        for name, (request, _) in METHODS.items()
    }
    server = grpc.server(ThreadPoolExecutor(4))
    server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler(SERVICE, handlers),))
    ego = RemoteEgo("far", f"127.0.0.1:{server.add_insecure_port('127.0.0.1:0')}", "1", deadline_s)
    server.start()
    try:
        ego.reset(EPISODE)
        yield ego
    finally:
        ego.close()
        server.stop(0)


@pytest.fixture(params=["stream of gRPC", "local socket"])
def talking(request: pytest.FixtureRequest) -> Callable[..., AbstractContextManager[RemoteEgo]]:
    """Begins a session over either transport."""

    def begin(acts: Acts, deadline_s: float = PATIENT_S) -> AbstractContextManager[RemoteEgo]:
        socket = listen(lambda requests, _: acts(requests)) if request.param == "local socket" else ""
        return session(acts, deadline_s, socket)

    return begin


def keeping(request: Observation) -> Command:
    return command_message(Control(1.0, 0.0), request.time_s)


def test_each_answer_has_the_whole_deadline(talking):
    def acts(requests):
        for request in requests:
            time.sleep(0.5)
            yield keeping(request)

    with talking(acts, deadline_s=4.0) as ego:
        for step in range(10):
            assert ego.act(perceived(0.1 * step)) == Control(1.0, 0.0)


def test_loopback_is_reached_whatever_proxy_there_is(talking, monkeypatch):
    for name in ("grpc_proxy", "https_proxy", "http_proxy"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")
    with talking(lambda requests: map(keeping, requests)) as ego:
        assert ego.act(perceived(0.0)) == Control(1.0, 0.0)


@pytest.mark.parametrize("answered", [0, 3])
def test_who_does_not_answer_in_time_has_failed(talking, answered):
    asked = threading.Event()

    def acts(requests):
        for step, request in enumerate(requests):
            if step == answered:
                asked.wait(PATIENT_S)
            yield keeping(request)

    with talking(acts, deadline_s=2.0) as ego:
        for step in range(answered):
            ego.act(perceived(0.1 * step))
        began = time.monotonic()
        with pytest.raises(EgoFailed, match="did not answer within 2 s") as failed:
            ego.act(perceived(9.0))
        asked.set()
    assert failed.value.reason == "ego_deadline"
    assert time.monotonic() - began >= 1.9


def test_a_socket_that_cannot_be_reached_from_here_is_not_needed():
    with session(lambda requests: map(keeping, requests), PATIENT_S, "risk-sac-ego-elsewhere") as ego:
        assert ego.act(perceived(0.0)) == Control(1.0, 0.0)


def twice(requests: Iterator[Observation]) -> Iterator[Command]:
    for request in requests:
        yield keeping(request)
        yield keeping(request)


def once(requests: Iterator[Observation]) -> Iterator[Command]:
    yield keeping(next(requests))


def raising(requests: Iterator[Observation]) -> Iterator[Command]:
    yield keeping(next(requests))
    raise ValueError("by me")


def huge(requests: Iterator[Observation]) -> Iterator[Command]:
    yield keeping(next(requests))
    rows = dict.fromkeys(("time_s", "x_m", "y_m", "speed_mps"), np.zeros(100_000))
    yield command_message(Trajectory(**rows), next(requests).time_s)


class Garbage:
    """A message that is none."""

    def SerializeToString(self) -> bytes:  # noqa: N802  # as protobuf calls it
        return b"\xff"


def garbled(requests: Iterator[Observation]) -> Iterator[Any]:
    yield keeping(next(requests))
    next(requests)
    yield Garbage()


def silent(requests: Iterator[Observation]) -> Iterator[Command]:
    yield keeping(next(requests))
    yield Command(time_s=next(requests).time_s)


@pytest.mark.parametrize(
    ("acts", "reason", "says"),
    [
        (twice, "ego_malformed", r"answered an observation of 0\.5 s; wanted that of 0\.6 s"),
        (silent, "ego_malformed", "neither a control nor a trajectory"),
        (huge, "ego_malformed", "larger than max"),
        (garbled, "ego_malformed", "parsing"),
        (once, "ego_crash", "ended the session"),
        (raising, "ego_crash", "by me"),
    ],
)
def test_an_answer_out_of_turn_or_none_is_not_driven(talking, acts, reason, says):
    with talking(acts) as ego:
        ego.act(perceived(0.5))
        with pytest.raises(EgoFailed, match=says) as failed:
            ego.act(perceived(0.6))
    assert failed.value.reason == reason


class Counting:
    """Commands how often it was asked, and tells when it is closed."""

    def __init__(self, closed: threading.Semaphore) -> None:
        self._closed = closed

    def reset(self, episode: EpisodeStart) -> None:
        self._asked = 0

    def act(self, perceived: Perceived) -> Control:
        self._asked += 1
        return Control(float(self._asked), 0.0)

    def close(self) -> None:
        self._closed.release()


def test_thirty_sessions_are_served_at_a_time_and_end_with_their_streams():
    closed = threading.Semaphore(0)
    server, port = serve(Sessions(lambda: Counting(closed), "1"), "127.0.0.1:0")
    with ExitStack() as stack:
        stack.callback(server.stop, 0)
        egos = [RemoteEgo("far", f"127.0.0.1:{port}", "1", PATIENT_S) for _ in range(30)]
        for ego in egos:
            ego.reset(EPISODE)
        for step in range(3):
            assert [ego.act(perceived(0.1 * step)).accel_mps2 for ego in egos] == [step + 1.0] * 30
        for ego in egos[:20]:
            ego.close()
        for ego in egos[20:]:  # as if the process were gone: the session stays open
            ego._stream.close()
        for _ in egos:
            assert closed.acquire(timeout=PATIENT_S)
        for ego in egos[20:]:
            ego.close()


REMOTE = Path("risk_sac/egos/remote")
OBSERVATION = Observation(
    session="ä1",
    time_s=1.5,
    actors={"id": ["ego", "lead"], "kind": [0, 1], "x_m": [0.0, -2.5]},
    signal=3,
    stop_line_m=math.inf,
)
# protoc --encode=risk_sac.egos.v2.Observation, of the same as text.
BY_PROTOC = bytes.fromhex(
    "0a03c3a43111000000000000f83f1a210a0365676f0a046c656164120200011a10000000000000000000000000000004c038034100000000"
    "0000f07f"
)


def test_a_message_has_the_bytes_that_other_languages_read():
    assert OBSERVATION.SerializeToString() == BY_PROTOC
    assert Observation.FromString(BY_PROTOC) == OBSERVATION


@pytest.mark.parametrize("name", ["ego", "osi"])
def test_stubs_are_generated_from_their_sources(name, tmp_path):
    command = [sys.executable, "-m", "grpc_tools.protoc", "-I.", f"--python_out={tmp_path}", REMOTE / f"{name}.proto"]
    subprocess.run(command, cwd=ROOT, check=True)
    stub = REMOTE / f"{name}_pb2.py"
    assert (tmp_path / stub).read_text() == (ROOT / stub).read_text(), "run `make protos`"
