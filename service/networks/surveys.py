"""The places of networks: searched once, in a process of its own, and kept beside the network."""

import json
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from risk_sac.errors import ConfigError
from risk_sac.execution.helper import ANSWER, run_helper
from risk_sac.scenario.library import VARIABLE
from service.errors import BusyError, StorageError
from service.networks.limits import SURVEY_MEMORY_BYTES, SURVEY_S
from service.networks.network_store import NetworkStore
from service.networks.report import PICTURE, PLACES
from service.networks.schemas import Places

SURVEYOR = "service.networks.surveyor"
NICENESS = 5
AT_ONCE = 2
RETRY_AFTER_S = 5
MOST_ASKING = 16  # of those threads that answer everybody
MOST_KEPT = 200  # answers that are remembered; what a network is never changes


class Surveys:
    """Finds places on networks; used by many threads."""

    def __init__(self, networks: NetworkStore, library: Path, stopping: Callable[[], bool] = lambda: False) -> None:
        """Starts nothing; `library` is the folder of places that campaigns are run at, `stopping` ends searches."""
        self._networks = networks
        self._library = library
        self._stopping = stopping
        self._room = threading.BoundedSemaphore(AT_ONCE)
        self._asking = threading.BoundedSemaphore(MOST_ASKING)
        self._counting = threading.Lock()
        self._locks: dict[tuple[str | None, ...], threading.Lock] = {}
        self._kept: dict[tuple[str, str, str | None], list[str]] = {}  # a form asks after each key that is pressed

    def places(self, network_id: str, project: str | None) -> Places:
        """Finds where the patterns fit on a network, and why elsewhere not; a ConfigError says why it cannot."""
        return Places.model_validate_json((self._searched(network_id, project) / PLACES).read_bytes())

    def picture(self, network_id: str, project: str | None) -> bytes:
        """The network from above with its places, PNG; raises what `places` does."""
        return (self._searched(network_id, project) / PICTURE).read_bytes()

    def keep(self, network_id: str, project: str | None, pattern: str, place: str | None) -> list[str]:
        """Makes families of a place, or of all places of a pattern, that can be run; returns their names."""
        folder = self._networks.folder(network_id, project)
        asked = network_id, pattern, place
        with self._alone(asked):
            families = self._kept.get(asked)
            if families is None or not self._still_there(families):
                families = self._run(folder, ["keep", pattern, *([] if place is None else [place])])["families"]
                if len(self._kept) >= MOST_KEPT:
                    self._kept.clear()
                self._kept[asked] = families
            return list(families)

    def _still_there(self, families: Sequence[str]) -> bool:
        """Whether the library has them; it will go on doing so for a while, since they are wanted."""
        try:
            for name in families:
                os.utime(self._library / name)
        except FileNotFoundError:
            return False
        except OSError as error:
            raise StorageError(f"the library of places cannot be written ({error.strerror})") from error
        return True

    def _searched(self, network_id: str, project: str | None) -> Path:
        folder = self._networks.folder(network_id, project)
        with self._alone((network_id,)):
            if not (folder / PLACES).exists():
                self._run(folder, ["survey"])
        return folder

    def _run(self, folder: Path, arguments: Sequence[str]) -> dict[str, Any]:
        environment = {"PATH": os.environ.get("PATH", os.defpath), VARIABLE: str(self._library.absolute())}
        environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MPLCONFIGDIR": str(self._library)}
        with self._turn():
            try:
                self._library.mkdir(parents=True, exist_ok=True)
                result = run_helper(
                    SURVEYOR,
                    [ANSWER, *arguments],
                    wall_s=SURVEY_S,
                    memory_bytes=SURVEY_MEMORY_BYTES,
                    niceness=NICENESS,
                    isolated=True,
                    cwd=folder,
                    environment=environment,
                    stopping=self._stopping,
                )
            except OSError as error:
                raise StorageError(f"places cannot be looked for ({error.strerror})") from error
        if result.timed_out:
            raise ConfigError(
                "network", f"one on which looking for places takes more than {SURVEY_S} s", "a smaller network"
            )
        try:
            report: dict[str, Any] = json.loads(result.answer)
        except ValueError as error:
            said = result.log.splitlines()[-1:]
            raise StorageError(f"places cannot be looked for (status {result.status}: {said})") from error
        if "refused" in report:
            raise ConfigError(*report["refused"])
        return report

    @contextmanager
    def _alone(self, asked: tuple[str | None, ...]) -> Iterator[None]:
        """Lets one of those who ask the same search, and the others wait for what it finds."""
        with self._counting:
            if len(self._locks) >= MOST_KEPT:
                self._locks.clear()  # who holds one of them goes on; at worst the same is searched twice
            lock = self._locks.setdefault(asked, threading.Lock())
        if not self._asking.acquire(blocking=False):
            raise BusyError(f"{MOST_ASKING} ask for places; try again in {RETRY_AFTER_S} s", RETRY_AFTER_S)
        try:
            with lock:
                yield
        finally:
            self._asking.release()

    @contextmanager
    def _turn(self) -> Iterator[None]:
        if not self._room.acquire(blocking=False):
            again = f"wanted fewer: try again in {RETRY_AFTER_S} s"
            raise BusyError(f"{AT_ONCE} searches for places are at work; {again}", RETRY_AFTER_S)
        try:
            yield
        finally:
            self._room.release()
