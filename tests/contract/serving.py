"""The real app on a socket, with an executor that starts nothing."""

import math
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from risk_sac.config import RunSpec
from risk_sac.execution.executor import Exited
from risk_sac.execution.messages import Event
from risk_sac.scenario.library import VARIABLE
from service.api.connections import Server
from service.app import create_app
from service.settings import ServiceSettings


class IdleExecutor:
    """Accepts runs and leaves them waiting until they are cancelled."""

    slots, cluster = math.inf, None

    def __init__(self) -> None:
        self._cancelled: list[int] = []
        self._wake = threading.Event()

    def submit(self, number: int, spec: RunSpec, folder: Path, slots: int) -> None:
        pass

    def cancel(self, number: int, grace_s: float) -> None:
        self._cancelled.append(number)
        self.wake()

    def events(self, timeout_s: float) -> list[tuple[int, Event | Exited]]:
        self._wake.wait(timeout_s)
        self._wake.clear()
        ended, self._cancelled = self._cancelled, []
        return [(number, Exited(None)) for number in dict.fromkeys(ended)]

    def wake(self) -> None:
        self._wake.set()

    def silent_s(self, number: int) -> None:
        pass

    def close(self) -> None:
        pass


@contextmanager
def serving(settings: ServiceSettings) -> Iterator[str]:
    """Where the app answers."""
    library_before = os.environ.get(VARIABLE)  # another server of this process may be in use when this one ends
    server = Server(create_app(settings, IdleExecutor()), settings, log_level="warning")
    # Of a named protocol: asyncio sets TCP_NODELAY on no other, and each answer would take 40 ms.
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.bind(("127.0.0.1", 0))
    thread = threading.Thread(target=server.run, args=([listener],))
    thread.start()
    try:
        while not server.started:
            assert thread.is_alive(), "the server did not start"
            time.sleep(0.01)
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join()
        listener.close()
        if library_before is not None:
            os.environ[VARIABLE] = library_before
