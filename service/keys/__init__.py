"""API keys: their file, and a running server's view of it.

A key reads `rsk_ID_SECRET`. The id is public and finds the record; of the secret only a hash is kept. One SHA-256 is
enough: slow hashes make guessable passwords expensive to guess, and 256 random bits cannot be guessed.
"""

import hashlib
import hmac
import logging
import os
import re
import secrets
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from risk_sac.errors import ConfigError, DamagedError
from risk_sac.host.machine import is_loopback
from risk_sac.run_folder.durable import lock, read_sealed, write_sealed
from service.errors import KeysError
from service.host import FILE_MODE, FOLDER_MODE
from service.settings import ServiceSettings

PROJECT = "[a-z0-9][a-z0-9-]{0,39}"
REMEDY = "restore keys.json from a copy, or delete it and make new keys by `risk-sac keys create`"
_TOKEN = re.compile(r"rsk_([0-9a-f]{8})_([A-Za-z0-9_-]{43})")

logger = logging.getLogger(__name__)


class Scope(StrEnum):
    """Permissions of a key; each scope includes those before it."""

    READ = "read"  # look at its project's campaigns
    RUN = "run"  # post, cancel and delete them
    ADMIN = "admin"  # all of that in every project; and see the metrics

    def includes(self, other: "Scope") -> bool:
        """Whether this scope allows what `other` allows."""
        order = list(Scope)
        return order.index(self) >= order.index(other)


class Key(BaseModel):
    """Stored record of a key. Times are seconds since the epoch."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: Annotated[str, Field(pattern="^[0-9a-f]{8}$")]
    project: Annotated[str, Field(pattern=f"^{PROJECT}$")]
    name: Annotated[str, Field(max_length=100)]
    scope: Scope
    created_at: float
    revoked_at: float | None = None
    hash: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]

    def opened_by(self, secret: str) -> bool:
        """Whether this is the key's secret and the key still counts."""
        # In constant time, or the time of the answer would tell how much of the hash is right.
        return hmac.compare_digest(self.hash, _hash(secret)) and self.revoked_at is None


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    keys: tuple[Key, ...]


class KeyFile:
    """Reads and changes the keys file, which is replaced as a whole.

    The lock file stays where a key was ever made. So a lost keys file differs from a service without keys.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = path.with_suffix(".lock")

    def read(self) -> tuple[Key, ...] | None:
        """Returns all keys by age; None if no key was ever made.

        Raises:
          KeysError: the file is lost, damaged, or cannot be read.
        """
        made = self._lock.exists()  # before the file is looked for, or its first key could seem lost
        try:
            return read_sealed(self.path, _Document).keys
        except FileNotFoundError as error:
            if not made:
                return None
            raise KeysError(f"keys file {str(self.path)!r} is missing, although keys were made; {REMEDY}") from error
        except DamagedError as error:
            raise KeysError(f"keys file {str(self.path)!r} is damaged; {REMEDY}") from error
        except OSError as error:
            raise KeysError(f"keys file {str(self.path)!r} cannot be read: {error.strerror}") from error

    def create(self, project: str, name: str, scope: Scope) -> tuple[Key, str]:
        """Adds a key and returns it with its token; ends keyless access."""
        with self._turn():
            keys = self.read() if self.path.exists() else None  # the first one replaces a lost file
            key_id, secret = secrets.token_hex(4), secrets.token_urlsafe(32)
            now = round(time.time(), 3)
            key = Key(id=key_id, project=project, name=name, scope=scope, created_at=now, hash=_hash(secret))
            self._write((*(keys or ()), key))
        return key, f"rsk_{key_id}_{secret}"

    def revoke(self, key_id: str) -> Key:
        """Makes a key invalid; has no effect on an invalid one."""
        if self.read() is None:
            raise _unknown(key_id)
        with self._turn():
            keys = {key.id: key for key in self.read() or ()}
            if key_id not in keys:
                raise _unknown(key_id)
            if keys[key_id].revoked_at is None:
                keys[key_id] = keys[key_id].model_copy(update={"revoked_at": round(time.time(), 3)})
                self._write(tuple(keys.values()))
        return keys[key_id]

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """Keeps other processes from changing the file meanwhile."""
        try:
            self.path.parent.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
            # A file of its own, because replacing the keys file would leave a lock on the old one.
            with lock(self._lock, wait=True):
                yield
        except OSError as error:
            raise KeysError(f"keys file {str(self.path)!r} cannot be written: {error.strerror}") from error

    def _write(self, keys: tuple[Key, ...]) -> None:
        write_sealed(self.path, _Document(keys=keys), mode=FILE_MODE)


class KeyRing:
    """A server's view of the keys, current at each request.

    A request costs one or two stats. With an unreadable or missing file each look-up raises until it is intact again.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._signature: tuple[int, ...] | None = None
        self._keys: Mapping[str, Key] | None = None
        self._problem = ""

    @property
    def open(self) -> bool:
        """Whether local processes need no key, because none was ever made."""
        return self._read() is None

    def find(self, token: str) -> Key | None:
        """Returns a token's valid key or None; KeysError without a readable file."""
        keys, parts = self._read() or {}, _TOKEN.fullmatch(token)
        key = None if parts is None else keys.get(parts[1])
        return key if key is not None and parts is not None and key.opened_by(parts[2]) else None

    def _read(self) -> Mapping[str, Key] | None:
        signature = _signature(self._path)
        if signature is None or signature != self._signature:
            # Before it is read: a change that comes between shows as another signature the next time.
            self._signature = None
            try:
                keys = KeyFile(self._path).read()
            except KeysError as error:
                if str(error) != self._problem:  # once, not with every request
                    logger.error("%s; until then every request is refused", error)
                self._problem = str(error)
                raise
            self._keys = None if keys is None else {key.id: key for key in keys}
            self._signature, self._problem = signature, ""
            if keys is not None:
                logger.info(
                    "%d API keys, %d of them revoked", len(keys), sum(key.revoked_at is not None for key in keys)
                )
        return self._keys


def _signature(path: Path) -> tuple[int, ...] | None:
    """Returns metadata that changes when the file is replaced, None if unreadable."""
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns, status.st_ctime_ns, status.st_size


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode("ascii")).hexdigest()


def _unknown(key_id: str) -> KeysError:
    return KeysError(f"id is {key_id!r}; wanted one that `risk-sac keys list` shows")


def fair_share(places: int, keys: int) -> int:
    """Returns a key's share of places, with one spare for new keys."""
    return max(1, places // (keys + 1))


def check_exposure(settings: ServiceSettings) -> None:
    """Refuses to serve other machines without keys, or with an unreadable file."""
    path = settings.keys_file
    keys = KeyFile(path).read() if path.exists() or not is_loopback(settings.host) else ()
    if is_loopback(settings.host) or any(key.revoked_at is None for key in keys or ()):
        return
    remedy = "create one with `risk-sac keys create`"
    raise ConfigError("host", repr(settings.host), "a loopback address, or API keys", remedy)
