"""Plays campaigns' failures against other egos, one regression at a time.

A regression is a file below its campaign's folder and is deleted with it. An unfinished one is played by the next
server. Its id is a digest of the request, so posting the same request again returns the existing one.
"""

import hashlib
import logging
import queue
import re
import threading
from collections import deque
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from pydantic import ValidationError

from risk_sac.config import EgoConfig
from risk_sac.egos.registry import pinned
from risk_sac.execution.helper import ANSWER, QUESTION, run_helper
from risk_sac.failures.bundle import code_digest
from risk_sac.failures.studied import CampaignRegression
from risk_sac.failures.studied import Regression as Cases
from risk_sac.records import State
from risk_sac.run_folder.durable import replace_file
from service.errors import ConflictError, NotFoundError, QuotaError, StorageError
from service.keys import fair_share
from service.settings import ServiceSettings
from service.store.stored import StoredCampaign

logger = logging.getLogger(__name__)

FOLDER = "regressions"
MOST_WAITING, RETRY_S = 16, 10.0
WALL_S = 24 * 3600.0
_ID = re.compile(r"([A-Za-z0-9]{1,100})-([0-9a-f]{16})", re.ASCII)


class StoredRegression(CampaignRegression):
    """A regression with the runs whose failures are played."""

    runs: tuple[str, ...]
    key_id: str | None = None
    """Key that posted it; null without one."""


class Waiting(NamedTuple):
    """Place in the queue."""

    file: Path | None
    """Of the regression; None wakes the thread to stop."""
    key_id: str | None = None


class TurnQueue(queue.Queue[Waiting]):
    """Queue that serves keys in turn, and each key's items in order."""

    def _init(self, maxsize: int) -> None:
        self.by_key: dict[str | None, deque[Waiting]] = {}  # the key that is next comes first

    def _qsize(self) -> int:
        return sum(map(len, self.by_key.values()))

    def _put(self, item: Waiting) -> None:
        self.by_key.setdefault(item.key_id, deque()).append(item)

    def _get(self) -> Waiting:
        key_id = next(iter(self.by_key))
        waiting = self.by_key.pop(key_id)
        item = waiting.popleft()
        if waiting:
            self.by_key[key_id] = waiting
        return item


def campaign_of(regression_id: str) -> str:
    """Id of the campaign that a regression is of.

    Raises:
      NotFoundError: no regression has such an id.
    """
    found = _ID.fullmatch(regression_id)
    if found is None:
        raise _unknown(regression_id)
    return found[1]


class Regressions:
    """Plays regressions, in a thread and a process of its own."""

    def __init__(self, settings: ServiceSettings) -> None:
        """Plays nothing yet; see `start`."""
        self._settings = settings
        self._queue = TurnQueue()
        self._stopping = threading.Event()
        self._posting = threading.Lock()
        self._thread = threading.Thread(target=self._work, name="regressions", daemon=True)

    def start(self) -> None:
        """Takes up what an earlier server left."""
        for file in sorted((self._settings.data_dir / "campaigns").glob(f"*/{FOLDER}/*.json")):
            try:
                regression = _read(file)
                if regression.state.final:
                    continue
                if regression.state is not State.QUEUED:  # the server before died while it played it
                    _write(file, regression.model_copy(update={"state": State.QUEUED}))
            except StorageError as error:
                logger.warning("%s", error)
                continue
            self._queue.put(Waiting(file, regression.key_id))
        self._thread.start()

    def stop(self) -> None:
        """Leaves what waits to the next server."""
        self._stopping.set()
        self._queue.put(Waiting(None))
        if self._thread.is_alive():
            self._thread.join()

    def post(self, campaign: StoredCampaign, ego: EgoConfig, key_id: str | None = None) -> StoredRegression:
        """Queues a regression, unless there is the same already.

        Raises:
          ConfigError: the ego is not registered, or in another version.
          ConflictError: the campaign has not ended, or none of its runs has succeeded.
          QuotaError: too many wait, or the key's share of them.
          StorageError: it cannot be written down.
        """
        ego = pinned(ego)
        runs = tuple(run.id for run in campaign.searches if run.state is State.SUCCEEDED)
        if not campaign.state.final or not runs:
            message = (
                f"campaign {campaign.id} is {campaign.state}; wanted one that has ended, with a run that succeeded"
            )
            raise ConflictError(message, reason="not_ended")
        named = "\n".join((*(f"{run.id} {run.digest}" for run in campaign.runs), ego.model_dump_json(), code_digest()))
        id_ = f"{campaign.id}-{hashlib.sha256(named.encode()).hexdigest()[:16]}"
        file = self._file(id_)
        with self._posting:
            if file.exists() and (known := _read(file)).state is not State.FAILED:
                return known
            self._check_room(key_id)
            now = datetime.now(UTC)
            posted = StoredRegression(
                id=id_, campaign_id=campaign.id, runs=runs, key_id=key_id, ego=ego, created_at=now
            )
            _write(file, posted)
            self._queue.put(Waiting(file, key_id))
        return posted

    def _check_room(self, key_id: str | None) -> None:
        with self._queue.mutex:
            waiting = {key: len(items) for key, items in self._queue.by_key.items()}
        if sum(waiting.values()) >= MOST_WAITING:
            raise QuotaError(f"{MOST_WAITING} regressions wait; wanted fewer", RETRY_S)
        share = fair_share(MOST_WAITING, len(waiting.keys() | {key_id}))
        if key_id is not None and waiting.get(key_id, 0) >= share:
            raise QuotaError(f"{share} regressions of this key wait, its share of the queue; wanted fewer", RETRY_S)

    def get(self, regression_id: str) -> StoredRegression:
        """Returns the regression with this id; callers check campaign access first.

        Raises:
          NotFoundError: there is none.
          StorageError: it cannot be read.
        """
        file = self._file(regression_id)
        if not file.exists():
            raise _unknown(regression_id)
        return _read(file)

    def _file(self, regression_id: str) -> Path:
        return self._settings.campaign_folder(campaign_of(regression_id)) / FOLDER / f"{regression_id}.json"

    def _work(self) -> None:
        while (file := self._queue.get().file) is not None and not self._stopping.is_set():
            try:
                self._play(file)
            except (OSError, StorageError) as error:  # the campaign may have been deleted meanwhile
                logger.warning("the regression %s is left as it is: %s", file.stem, error)

    def _play(self, file: Path) -> None:
        asked = _read(file).model_copy(update={"state": State.RUNNING})
        _write(file, asked)
        runs = [str(self._settings.run_folder(asked.campaign_id, run)) for run in asked.runs]
        result = run_helper(
            "risk_sac",
            ["regress", "--failures", *runs, "--ego", QUESTION, "--out", ANSWER],
            question=asked.ego.model_dump_json().encode(),  # JSON is YAML
            wall_s=WALL_S,
            niceness=self._settings.worker_niceness,
            stopping=self._stopping.is_set,
        )
        if self._stopping.is_set():
            return
        if result.answer:
            ended = {"state": State.SUCCEEDED, "cases": Cases.model_validate_json(result.answer).cases}
        else:
            ended = {"state": State.FAILED, "reason": result.reason}
        done = asked.model_copy(update={"finished_at": datetime.now(UTC)} | ended)
        _write(file, done)


def _read(file: Path) -> StoredRegression:
    try:
        return StoredRegression.model_validate_json(file.read_bytes())
    except (OSError, ValidationError) as error:
        raise StorageError(f"the regression {file.stem} is damaged or gone") from error


def _write(file: Path, regression: StoredRegression) -> None:
    """Writes a regression into its campaign's folder, which must already exist."""
    try:
        file.parent.mkdir(exist_ok=True)
        replace_file(file, regression.model_dump_json(indent=2).encode())
    except OSError as error:
        raise StorageError(f"the regression {file.stem} cannot be written ({error.strerror})") from error


def _unknown(regression_id: str) -> NotFoundError:
    return NotFoundError(f"there is no regression {regression_id!r}", field="regression_id", got=regression_id)
