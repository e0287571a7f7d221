"""Searches places of networks in a separate process, and keeps them."""

import json
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from risk_sac.errors import DamagedError
from risk_sac.run_folder.durable import read_sealed
from service.errors import BusyError, disk_refusals
from service.networks.network_store import NetworkStore
from service.networks.scenarios import ask_helper
from service.networks.schemas import PICTURE, PLACES, PROGRESS, ROADS, SURVEY_S, Places

AT_ONCE = 2
MOST_WAITING = 16
RETRY_AFTER_S = 5
PATIENCE_S = 50  # that a request waits for a search; proxies give up after 60
MOST_KEPT = 200  # jobs that are remembered; what a network is never changes

Asked = tuple[str | None, ...]


class Surveys:
    """Runs searches for places as jobs that several requests may await."""

    def __init__(self, networks: NetworkStore, library: Path, stopping: Callable[[], bool] = lambda: False) -> None:
        """Starts nothing; `library` stores kept places, `stopping` ends searches."""
        self._networks = networks
        self._library = library
        self._pools = {action: ThreadPoolExecutor(AT_ONCE, action) for action in ("survey", "keep")}
        self._lock = threading.Lock()
        self._jobs: dict[Asked, Future[dict[str, Any]]] = {}
        self._stopping = stopping
        self._stopped = threading.Event()

    def stop(self) -> None:
        """Ends all searches; they begin again when they are asked for."""
        self._stopped.set()
        for pool in self._pools.values():
            pool.shutdown(cancel_futures=True)

    def places(self, network_id: str, project: str | None) -> Places:
        """Returns where the patterns fit; its progress is below 1 while unknown.

        Raises:
          ConfigError: nothing can be found on it.
        """
        folder = self._networks.folder(network_id, project)
        try:
            return read_sealed(folder / PLACES, Places)
        except (FileNotFoundError, DamagedError):  # one of an earlier version has no seal
            job = self._job((network_id,), folder, ["survey"])
        try:
            _result(job, PATIENCE_S)
        except TimeoutError:
            return Places(items=[], elsewhere=[], progress=_progress(folder))
        return read_sealed(folder / PLACES, Places)

    def picture(self, network_id: str, project: str | None) -> bytes:
        """Draws the network and places as PNG; raises BusyError until drawn."""
        return self._left(network_id, project, PICTURE)

    def roads(self, network_id: str, project: str | None) -> bytes:
        """Returns the ground of the network as JSON; raises as `picture`."""
        return self._left(network_id, project, ROADS)

    def _left(self, network_id: str, project: str | None, name: str) -> bytes:
        """Reads a file that the search for places leaves."""
        if (places := self.places(network_id, project)).progress < 1:
            said = f"the places are searched for ({places.progress:.0%}); try again in {RETRY_AFTER_S} s"
            raise BusyError(said, RETRY_AFTER_S)
        folder = self._networks.folder(network_id, project)
        if not (folder / name).exists():  # an earlier version searched
            _result(self._job((network_id,), folder, ["survey"]))
        return (folder / name).read_bytes()

    def keep(self, network_id: str, project: str | None, pattern: str, place: str | None) -> list[str]:
        """Stores a place, or all of a pattern, as families; returns names."""
        folder = self._networks.folder(network_id, project)
        asked = network_id, pattern, place
        arguments = ["keep", pattern, *([] if place is None else [place])]
        families: list[str] = _result(self._job(asked, folder, arguments))["families"]
        if not self._still_there(families):
            self._jobs.pop(asked, None)
            families = _result(self._job(asked, folder, arguments))["families"]
        return list(families)

    def _still_there(self, families: Sequence[str]) -> bool:
        """Returns whether the library has them, and marks them as used."""
        with disk_refusals("the library of places cannot be written"):
            try:
                for name in families:
                    os.utime(self._library / name)
            except FileNotFoundError:
                return False
            return True

    def _job(self, asked: Asked, folder: Path, arguments: Sequence[str]) -> Future[dict[str, Any]]:
        """Returns the running or finished job for a question, or starts one."""
        with self._lock:
            job = self._jobs.get(asked)
            if job is not None and not (job.done() and (len(asked) == 1 or job.exception())):
                return job
            if sum(not job.done() for job in self._jobs.values()) >= MOST_WAITING:
                said = f"{MOST_WAITING} searches for places are asked for; try again in {RETRY_AFTER_S} s"
                raise BusyError(said, RETRY_AFTER_S)
            if len(self._jobs) >= MOST_KEPT:
                self._jobs = {key: job for key, job in self._jobs.items() if not job.done()}
            self._jobs[asked] = self._pools[arguments[0]].submit(self._run, folder, arguments)
            return self._jobs[asked]

    def _run(self, folder: Path, arguments: Sequence[str]) -> dict[str, Any]:
        self._networks.check_files(folder)
        too_slow = "network", f"one on which looking for places takes more than {SURVEY_S} s", "a smaller network"
        try:
            report: dict[str, Any] = json.loads(
                ask_helper(
                    arguments,
                    self._library,
                    "places cannot be looked for",
                    too_slow,
                    wall_s=SURVEY_S,
                    isolated=True,
                    cwd=folder,
                    environment={"PATH": os.environ.get("PATH", os.defpath), "MPLCONFIGDIR": str(self._library)},
                    stopping=lambda: self._stopped.is_set() or self._stopping(),
                )
            )
        finally:
            (folder / PROGRESS).unlink(missing_ok=True)
        return report


def _result(job: Future[dict[str, Any]], patience_s: float | None = None) -> dict[str, Any]:
    try:
        return job.result(patience_s)
    except CancelledError as error:
        raise BusyError("the service stops; try again when it is back", RETRY_AFTER_S) from error


def _progress(folder: Path) -> float:
    try:
        return min(float((folder / PROGRESS).read_text()), 0.99)
    except (OSError, ValueError):  # not begun, or just being written
        return 0.0
