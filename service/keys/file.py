"""The keys on disk: one small file, replaced as a whole."""

import fcntl
import hashlib
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import to_json

from risk_sac.run_folder.durable import sync_folder
from service.errors import KeysError
from service.keys.key import Key, Scope, mint


class _Document(BaseModel):
    """The file; the checksum notices a flipped bit where JSON would not, in a project's name say."""

    model_config = ConfigDict(extra="forbid")

    keys: tuple[Key, ...]
    sha256: str


class KeyFile:
    """Reads and changes the keys file; commands that change it take turns."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> tuple[Key, ...]:
        """All keys, in the order of their creation; none where there is no file.

        Raises:
          KeysError: the file cannot be read, or is damaged.
        """
        try:
            return _parse(self.path.read_bytes(), self.path)
        except FileNotFoundError:
            return ()
        except OSError as error:
            raise KeysError(f"keys file {str(self.path)!r} cannot be read: {error.strerror}") from error

    def create(self, project: str, name: str, scope: Scope) -> tuple[Key, str]:
        """Adds a key; returns it with the token that its holder needs.

        Raises:
          KeysError: the file cannot be read, is damaged, or cannot be written.
        """
        with self._changing() as keys:
            key, token = mint(project, name, scope)
            while any(key.id == other.id for other in keys):
                key, token = mint(project, name, scope)
            keys.append(key)
        return key, token

    def revoke(self, key_id: str) -> Key:
        """Makes a key worthless; does nothing to one that is already.

        Raises:
          KeysError: no key has this id; or as `create`.
        """
        with self._changing() as keys:
            for index, key in enumerate(keys):
                if key.id == key_id:
                    if key.revoked_at is None:
                        keys[index] = key.model_copy(update={"revoked_at": round(time.time(), 3)})
                    return keys[index]
            raise KeysError(f"id is {key_id!r}; wanted one that `risk-sac keys list` shows")

    @contextmanager
    def _changing(self) -> Iterator[list[Key]]:
        """The keys as a list whose changes are written, with nobody else changing them meanwhile."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            # A file of its own, because replacing the keys file would leave a lock on the old one.
            with self.path.with_suffix(".lock").open("ab") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                keys = list(self.read())
                yield keys
                self._write(tuple(keys))
        except OSError as error:
            raise KeysError(f"keys file {str(self.path)!r} cannot be written: {error.strerror}") from error

    def _write(self, keys: tuple[Key, ...]) -> None:
        """Replaces the file; after a crash there is the old one or the new one, on disk and whole."""
        temporary = self.path.with_suffix(".tmp")
        document = _Document(keys=keys, sha256=_checksum(keys))
        temporary.unlink(missing_ok=True)
        with open(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(document.model_dump_json(indent=1).encode())
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(self.path)
        sync_folder(self.path.parent)


def _parse(content: bytes, path: Path) -> tuple[Key, ...]:
    damaged = f"keys file {str(path)!r} is damaged; restore it from a copy, or remove it and create new keys"
    try:
        document = _Document.model_validate_json(content)
    except ValidationError as error:
        raise KeysError(damaged) from error
    if document.sha256 != _checksum(document.keys):
        raise KeysError(damaged)
    return document.keys


def _checksum(keys: tuple[Key, ...]) -> str:
    return hashlib.sha256(to_json(keys)).hexdigest()
