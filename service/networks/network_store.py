"""Receives uploads and stores the networks that the checker accepts."""

import hashlib
import logging
import os
import re
import secrets
import shutil
import signal
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from risk_sac.errors import DamagedError
from risk_sac.execution.helper import ANSWER, run_helper
from risk_sac.run_folder.durable import read_sealed, seal, sync_folder
from service.errors import BusyError, ConflictError, NotFoundError, QuotaError, StorageError, UploadError, disk_refusals
from service.networks.schemas import LOG_BYTES, WALL_S, BoundingBox, CheckReport, Network, StoredNetwork
from service.store.stored import StoredPage

logger = logging.getLogger(__name__)

CHECKER = "service.networks.checker"
UPLOAD, LOG = "upload", "log"
_GRACE_S = 0.5  # for starting; the checker ends itself after WALL_S
_TOO_SLOW = (signal.SIGALRM, signal.SIGXCPU, signal.SIGKILL)
_REPORTS = TypeAdapter(CheckReport)


class Incoming:
    """Upload that is written to disk on arrival; its opener closes it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.bytes = 0
        self._hash = hashlib.sha256()
        self._file = (folder / UPLOAD).open("wb")

    def write(self, chunk: bytes) -> None:
        """Writes one more piece of the upload."""
        self.bytes += len(chunk)
        self._hash.update(chunk)
        with disk_refusals("an upload cannot be received"):
            self._file.write(chunk)

    def complete(self) -> str:
        """Returns the SHA-256 of the upload, now that it is there."""
        self._file.close()
        return self._hash.hexdigest()

    def strip(self) -> None:
        """Removes all but the files that the checker rewrote."""
        for name in (UPLOAD, LOG):
            (self.folder / name).unlink()

    def discard(self) -> None:
        """Remove whatever is still there."""
        self._file.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def inspect(folder: Path, checker: str = CHECKER, wall_s: float = WALL_S) -> CheckReport:
    """Checks a folder's `upload` in a separate process; returns the report."""
    with disk_refusals("the upload cannot be checked"):
        result = run_helper(
            checker,
            [ANSWER],
            wall_s=wall_s + _GRACE_S,
            isolated=True,
            cwd=folder,
            environment={"PATH": os.environ.get("PATH", os.defpath)},
            log=folder / LOG,
        )
    status = result.status
    if status < 0:
        raise UploadError(_ended_by(-status, wall_s))
    try:
        report = _REPORTS.validate_json(result.answer[:LOG_BYTES])
    except ValidationError as error:
        logger.error("the checker exited with status %d, wrote %r: %s", status, result.answer[:200], result.log)
        raise StorageError(f"the upload cannot be checked (status {status}); the log has the reason") from error
    if report.refused is not None:
        raise UploadError(report.refused)
    return report


def _ended_by(number: int, wall_s: float) -> str:
    if number in _TOO_SLOW:
        return f"checking the upload takes more than {wall_s:g} s; wanted a smaller network"
    name = signal.Signals(number).name if number in list(signal.Signals) else f"signal {number}"
    return f"the simulator cannot load it: it was ended by {name}"


UPLOADS_AT_ONCE = 4  # being received or checked
UPLOADS_OF_ONE = 2  # of them, from the holder of one key
MOST = 200  # networks of one project
RETRY_AFTER_S = 5
INCOMING = ".incoming"  # no project's name starts with a dot
RECORD = "network.json"
_ID = re.compile("n[0-9a-f]{16}")
_RANDOM_BITS = 19  # with the time in ms, an id has 63 bits: enough for a cursor, until the year 2527


class NetworkStore:
    """Adds, lists, finds and deletes networks; used by many threads."""

    def __init__(self, folder: Path, *, most: int = MOST, at_once: int = UPLOADS_AT_ONCE) -> None:
        """Removes unfinished uploads; allows `most` networks per project and `at_once` uploads."""
        self._folder = folder
        self._most = most
        self._at_once = at_once
        self._at_work = Counter[str | None]()  # uploads, by key
        self._counting = threading.Lock()
        self._adding = threading.Lock()
        shutil.rmtree(folder / INCOMING, ignore_errors=True)

    @contextmanager
    def receive(self, key_id: str | None = None) -> Iterator[Incoming]:
        """Makes a folder for one upload, removed unless `add` keeps it."""
        with self._counting:
            self._check_share(key_id)
            self._at_work[key_id] += 1
        try:
            with disk_refusals("an upload cannot be received"):
                (self._folder / INCOMING).mkdir(parents=True, exist_ok=True)
                incoming = Incoming(Path(tempfile.mkdtemp(dir=self._folder / INCOMING)))
            try:
                yield incoming
            finally:
                incoming.discard()
        finally:
            with self._counting:
                self._at_work[key_id] -= 1

    def _check_share(self, key_id: str | None) -> None:
        again = f"wanted fewer: try again in {RETRY_AFTER_S} s"
        if self._at_work[key_id] >= UPLOADS_OF_ONE:
            raise QuotaError(f"{UPLOADS_OF_ONE} uploads of this key are at work; {again}", RETRY_AFTER_S)
        if self._at_work.total() >= self._at_once:
            raise BusyError(f"{self._at_once} uploads are at work; {again}", RETRY_AFTER_S)

    def add(self, incoming: Incoming, project: str, label: str) -> Network:
        """Checks an upload that has arrived, and keeps it."""
        self._check_room(project)
        with disk_refusals("a network cannot be stored"):
            sha256 = incoming.complete()
            report = inspect(incoming.folder)
            network = _network(report, label, sha256, incoming.bytes)
            incoming.strip()
            (incoming.folder / RECORD).write_bytes(seal(StoredNetwork(network=network)))
            _sync(incoming.folder)
            with self._adding:
                self._check_room(project)
                home = self._folder / project
                home.mkdir(exist_ok=True)
                incoming.folder.rename(home / network.id)
                sync_folder(home)
                sync_folder(self._folder)
        logger.info("network %s of project %s: %d edges", network.id, project, network.edges)
        return network

    def uploaded_before(self, incoming: Incoming, project: str) -> Network | None:
        """Finds the project's network with the same bytes as a received upload."""
        sha256 = incoming.complete()
        with disk_refusals("the networks cannot be read"):
            every = (network for path in self._paths(project) if (network := _readable(path)) is not None)
            return next((network for network in every if network.sha256 == sha256), None)

    def list(self, limit: int, before: int | None, project: str | None) -> StoredPage[Network]:
        """Lists networks, newest first, before an earlier page's `last`; skips damaged ones."""
        with disk_refusals("the networks cannot be read"):
            found = sorted((int(path.name[1:], 16), path) for path in self._paths(project))
            older = [(number, path) for number, path in reversed(found) if before is None or number < before]
            page = older[:limit]
            items = [network for _, path in page if (network := _readable(path)) is not None]
        return StoredPage(items=tuple(items), last=page[-1][0] if len(older) > limit else None)

    def get(self, network_id: str, project: str | None) -> Network:
        """Returns one network; raises NotFoundError if it is missing or another project's."""
        path = self._path(network_id, project)
        with disk_refusals("a network cannot be read"):
            return _read(path)

    def folder(self, network_id: str, project: str | None) -> Path:
        """Returns the folder of a network; raises what `get` does."""
        self.get(network_id, project)
        return self._path(network_id, project)

    def check_files(self, folder: Path) -> None:
        """Raises `StorageError` if a network's file differs from what was checked."""
        with disk_refusals("a network cannot be read"):
            for file in _read(folder).files:
                if hashlib.sha256((folder / file.name).read_bytes()).hexdigest() != file.sha256:
                    raise StorageError(
                        f"network {folder.name} is damaged: {file.name} is not as it was written; upload the map again"
                    )

    def delete(self, network_id: str, project: str | None) -> None:
        """Removes a network, first from the listing and then from the disk."""
        path = self._path(network_id, project)
        grave = self._folder / INCOMING / f"deleted-{network_id}-{secrets.token_hex(4)}"
        with disk_refusals("a network cannot be deleted"):
            grave.parent.mkdir(exist_ok=True)
            path.rename(grave)
            sync_folder(path.parent)
            shutil.rmtree(grave)

    def _paths(self, project: str | None) -> Iterator[Path]:
        homes = self._folder.glob("[!.]*") if project is None else [self._folder / project]
        return (path for home in homes if home.is_dir() for path in home.iterdir() if _ID.fullmatch(path.name))

    def _path(self, network_id: str, project: str | None) -> Path:
        with disk_refusals("the networks cannot be read"):
            for path in self._paths(project):
                if path.name == network_id:
                    return path
        raise NotFoundError(f"there is no network {network_id!r}", field="network_id", got=network_id)

    def _check_room(self, project: str) -> None:
        count = sum(1 for _ in self._paths(project))
        if count >= self._most:
            raise ConflictError(
                f"project {project!r} has {count} networks; wanted fewer than {self._most}: delete one first",
                reason="too_many_networks",
            )


def _network(report: CheckReport, label: str, sha256: str, size: int) -> Network:
    now = time.time()
    number = int(now * 1000) << _RANDOM_BITS | secrets.randbits(_RANDOM_BITS)
    assert report.summary is not None
    sent = {"label": label, "created_at": datetime.fromtimestamp(now, UTC), "sha256": sha256, "bytes": size}
    box = dict(zip(BoundingBox.model_fields, report.summary.bounding_box, strict=True))
    found = asdict(report.summary) | {"files": report.files, "warnings": report.warnings, "bounding_box": box}
    return Network.model_validate({"id": f"n{number:016x}"} | sent | found)


def _read(folder: Path) -> Network:
    try:
        return read_sealed(folder / RECORD, StoredNetwork).network
    except DamagedError as error:
        raise StorageError(f"network {folder.name} is damaged: {error}") from error


def _readable(folder: Path) -> Network | None:
    try:
        return _read(folder)
    except (StorageError, FileNotFoundError) as error:  # not there any more: deleted meanwhile
        logger.warning("%s", error)
        return None


def _sync(folder: Path) -> None:
    for path in folder.iterdir():
        sync_folder(path)  # a file's descriptor, too, writes down the file
    sync_folder(folder)
