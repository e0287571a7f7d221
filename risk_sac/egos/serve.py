"""Serves a Python ego: `python -m risk_sac.egos.serve my_egos:Follower --address 127.0.0.1:50051`.

It is the reference for egos in other languages.
"""

import argparse
import json
import math
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, redirect_stdout
from functools import partial
from typing import Any

import grpc
import numpy as np

from risk_sac.egos.guard import MALFORMED, Guarded
from risk_sac.egos.registry import EgoCard, make
from risk_sac.egos.remote import ego_pb2
from risk_sac.egos.remote.messages import (
    METHODS,
    PROTOCOL,
    SERVICE,
    command_message,
    episode_of,
    listen,
    path_of,
    perceived_of,
)
from risk_sac.egos.seam import Ego, EpisodeStart, Vehicle
from risk_sac.errors import ConfigError, EgoFailed
from risk_sac.world.types import STEP_S, Kind, Lane, Road, Signal

MOST_SESSIONS = 64  # the oldest goes: a client that never acted closed nothing
SPARE_THREADS = 16  # beside one for each session: to start and to close them


class Sessions:
    """Sessions that are open, each with an ego of its own.

    Attributes:
      socket: name of the local socket that takes their steps, too; "" without one.
    """

    socket = ""

    def __init__(self, make_ego: Callable[[], Ego], version: str) -> None:
        self._make, self._version = make_ego, version
        self._egos: dict[str, Guarded] = {}  # by session
        self._lock = threading.Lock()

    def start(self, request: Any, context: Any) -> Any:
        """Begins an episode."""
        if request.protocol != PROTOCOL:
            context.abort(grpc.StatusCode.FAILED_PRECONDITION, f"protocol {request.protocol}; wanted {PROTOCOL}")
        with _told(context):
            ego = Guarded(self._make, math.inf)
            ego.reset(episode_of(request))
        with self._lock:
            while len(self._egos) >= MOST_SESSIONS:
                self._egos.pop(next(iter(self._egos))).close()
            self._egos[request.session] = ego
        return ego_pb2.StartReply(version=self._version, socket=self.socket)

    def act(self, requests: Iterator[Any], context: Any) -> Iterator[Any]:
        """Answers an episode's steps; then ends the session, even without the client."""
        name, path = "", np.empty((0, 0))
        try:
            for request in requests:
                name = request.session
                if name not in self._egos:
                    context.abort(grpc.StatusCode.NOT_FOUND, f"there is no session {name!r}")
                if request.HasField("path"):
                    path = path_of(request.path)
                with _told(context):
                    command = self._egos[name].act(perceived_of(request, path))
                yield command_message(command, request.time_s)
        finally:
            self._end(name)

    def close(self, request: Any, context: Any) -> Any:
        """Ends an episode."""
        self._end(request.session)
        return ego_pb2.CloseReply()

    def _end(self, name: str) -> None:
        with self._lock:
            ego = self._egos.pop(name, None)
        if ego is not None:
            ego.close()


@contextmanager
def _told(context: Any) -> Iterator[None]:
    """Tells the client an ego's failure; the deadline is the client's."""
    try:
        yield
    except EgoFailed as failed:
        malformed = failed.reason == MALFORMED
        context.abort(grpc.StatusCode.INVALID_ARGUMENT if malformed else grpc.StatusCode.INTERNAL, str(failed))


def warm_up(ego: Guarded) -> None:
    """Drives an ego one step, so that compilation precedes any deadline."""
    along, still = np.array([0.0, 50.0, 100.0]), np.zeros(3)
    lane = Lane("lane", np.array([along, still]), 3.3, 13.9, "", "", False, False, (), True)
    car = Vehicle(length_m=4.6, width_m=1.85)
    ego.reset(EpisodeStart(seed=0, net="", route=(), vehicle=car, step_s=STEP_S, road=Road((lane,))))
    path = np.array([along, still, along, still, np.full(3, 13.9), np.cos(still), np.sin(still)])
    actors = ego_pb2.Actors(
        id=["ego", "lead", "walker"],
        kind=[Kind.VEHICLE, Kind.VEHICLE, Kind.PEDESTRIAN],
        x_m=[0.0, 30.0, 60.0],
        y_m=[0.0, 0.0, 5.0],
        heading_rad=still,
        vx_mps=[10.0, 10.0, 0.0],
        vy_mps=still,
        length_m=[4.6, 4.6, 0.5],
        width_m=[1.85, 1.85, 0.5],
    )
    seen = ego_pb2.Observation(actors=actors, speed_mps=10.0, station_m=2.3, signal=Signal.RED, stop_line_m=50.0)
    ego.act(perceived_of(seen, path))
    ego.close()


def serve(sessions: Sessions, address: str) -> tuple[grpc.Server, int]:
    """Returns a started server and its port; RuntimeError if it cannot listen."""
    answers = {
        "Start": partial(grpc.unary_unary_rpc_method_handler, sessions.start),
        "Act": partial(grpc.stream_stream_rpc_method_handler, sessions.act),
        "Close": partial(grpc.unary_unary_rpc_method_handler, sessions.close),
    }
    handlers = {
        name: answers[name](request_deserializer=request.FromString, response_serializer=reply.SerializeToString)
        for name, (request, reply) in METHODS.items()
    }
    # Without the option a second server would share the port, and every other session.
    threads = ThreadPoolExecutor(MOST_SESSIONS + SPARE_THREADS)
    server = grpc.server(threads, options=[("grpc.so_reuseport", 0)])
    server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler(SERVICE, handlers),))
    port = server.add_insecure_port(address)
    sessions.socket = listen(sessions.act)
    server.start()
    return server, port


def table(name: str, address: str, card: EgoCard) -> str:
    """Returns the TOML table for RISK_SAC_EGOS that registers a served ego."""
    told = {"address": address} | card.model_dump(include={"version", "summary", "response_time_s", "deadline_s"})
    return "\n".join([f"[{name}]", *(f"{key} = {json.dumps(value)}" for key, value in told.items())])


def main() -> None:
    """Serves until killed; prints port and version, or registration, once it listens."""
    parser = argparse.ArgumentParser(description="Serves a Python ego by the protocol of ego.proto.")
    parser.add_argument("ego", help="name of a registered one, or module:Class")
    parser.add_argument("--address", default="127.0.0.1:0", help="to listen on; port 0 is any (default: %(default)s)")
    lines = "print the lines with which an operator registers it by this name, for the file of RISK_SAC_EGOS"
    parser.add_argument("--register", metavar="NAME", help=lines)
    options = parser.parse_args()
    try:
        with redirect_stdout(sys.stderr):  # what the ego prints is not what is read from here
            make_ego, card = make(options.ego, options.register or "ego")
            warm_up(Guarded(make_ego, math.inf))
        server, port = serve(Sessions(make_ego, card.version), options.address)
    except (ConfigError, EgoFailed, RuntimeError) as error:
        parser.error(str(error))
    said = f"{options.ego} {card.version} listens on port {port}"
    if options.register is not None:
        address, any_port = options.address, ":0"
        said = table(options.register, address.removesuffix(any_port) + f":{port}" * address.endswith(any_port), card)
    print(said, flush=True)  # noqa: T201 - for who started it
    server.wait_for_termination()


if __name__ == "__main__":
    main()
