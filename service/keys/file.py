"""The API keys on disk: one small file, replaced as a whole.

A key reads `rsk_ID_SECRET`. The id is public and finds the record; of the secret only a hash is kept. One SHA-256 is
enough: slow hashes make guessable passwords expensive to guess, and 256 random bits cannot be guessed.
"""

import hashlib
import hmac
import re
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from risk_sac.errors import DamagedError
from risk_sac.run_folder.durable import lock, read_sealed, write_sealed
from service.errors import KeysError
from service.host.data_folder import FILE_MODE, FOLDER_MODE

PROJECT = "[a-z0-9][a-z0-9-]{0,39}"
REMEDY = "restore their file from a copy, or make a new one by `risk-sac keys create --replace-file`"
_TOKEN = re.compile(r"rsk_([0-9a-f]{8})_([A-Za-z0-9_-]{43})")


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


class Document(BaseModel):
    """Content of the file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    keys: tuple[Key, ...]
    open: bool = False
    """Whether processes of this machine need no key, because an administrator said so."""


class DamagedKeysError(KeysError):
    """The file of keys is not as it was written."""


class KeyFile:
    """Reads and changes the keys file; commands that change it take turns."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def load(self) -> Document | None:
        """Reads the file; None where there is none.

        Raises:
          KeysError: it is damaged, or cannot be read.
        """
        try:
            return read_sealed(self.path, Document)
        except FileNotFoundError:
            return None
        except DamagedError as error:
            raise DamagedKeysError(_unusable(self.path, "damaged")) from error
        except OSError as error:
            raise KeysError(f"keys file {str(self.path)!r} cannot be read: {error.strerror}") from error

    def read(self) -> tuple[Key, ...]:
        """Returns all keys, in the order of their creation; none where there is no file."""
        document = self.load()
        return () if document is None else document.keys

    def create(self, project: str, name: str, scope: Scope) -> tuple[Key, str]:
        """Adds a key and returns it with its token; from now on every caller needs a key."""
        with self._turn():
            keys = self.read()
            key, token = _mint(project, name, scope, {key.id for key in keys})
            self._write(Document(keys=(*keys, key)))
        return key, token

    def replace(self, project: str, name: str, scope: Scope) -> tuple[Key, str]:
        """Makes the first key of a new file; refuses to replace an intact one."""
        with self._turn():
            try:
                whole = self.load() is not None
            except DamagedKeysError:
                whole = False
            if whole:
                raise KeysError(
                    f"keys file {str(self.path)!r} is intact; wanted a lost or damaged one: `revoke` its keys"
                )
            key, token = _mint(project, name, scope, set())
            self._write(Document(keys=(key,)))
        return key, token

    def open_all(self) -> None:
        """Deletes all keys; every local process may then call without a key."""
        with self._turn():
            self._write(Document(keys=(), open=True))

    def revoke(self, key_id: str) -> Key:
        """Makes a key invalid; has no effect on an invalid one."""
        with self._turn():
            keys = {key.id: key for key in self.read()}
            if key_id not in keys:
                raise KeysError(f"id is {key_id!r}; wanted one that `risk-sac keys list` shows")
            if keys[key_id].revoked_at is None:
                keys[key_id] = keys[key_id].model_copy(update={"revoked_at": round(time.time(), 3)})
                self._write(Document(keys=tuple(keys.values())))
        return keys[key_id]

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """Keeps other processes from changing the file meanwhile."""
        try:
            self.path.parent.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
            # A file of its own, because replacing the keys file would leave a lock on the old one.
            with lock(self.path.with_suffix(".lock"), wait=True):
                yield
        except OSError as error:
            raise KeysError(f"keys file {str(self.path)!r} cannot be written: {error.strerror}") from error

    def _write(self, document: Document) -> None:
        write_sealed(self.path, document, mode=FILE_MODE)


def _mint(project: str, name: str, scope: Scope, taken: set[str]) -> tuple[Key, str]:
    """Returns a new key's record and its token, which is shown once and not stored."""
    while (key_id := secrets.token_hex(4)) in taken:
        pass
    secret = secrets.token_urlsafe(32)
    key = Key(id=key_id, project=project, name=name, scope=scope, created_at=round(time.time(), 3), hash=_hash(secret))
    return key, f"rsk_{key_id}_{secret}"


def split(token: str) -> tuple[str, str] | None:
    """Splits a token into id and secret; None if it is malformed."""
    found = _TOKEN.fullmatch(token)
    return None if found is None else (found[1], found[2])


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode("ascii")).hexdigest()


def missing(path: Path) -> KeysError:
    """Returns the error for a missing file although keys were made."""
    return KeysError(_unusable(path, "missing, although keys were made"))


def _unusable(path: Path, how: str) -> str:
    return f"keys file {str(path)!r} is {how}; {REMEDY}, which makes all earlier keys invalid"
