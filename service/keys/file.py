"""The keys on disk: one small file, replaced as a whole."""

import fcntl
import hashlib
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import to_json

from risk_sac.run_folder.durable import sync_folder
from service.errors import KeysError
from service.host.private import FOLDER_MODE
from service.keys.key import Key, Scope, mint

REMEDY = "restore their file from a copy, or begin anew with `risk-sac keys create --anew`"


class Document(BaseModel):
    """What the file says; the checksum notices a flipped bit where JSON would not, in a project's name say."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    keys: tuple[Key, ...]
    open: bool = False
    """Whether nobody of this machine needs a key: somebody asked for it. That there are no keys does not mean it."""
    sha256: str

    @classmethod
    def of(cls, keys: tuple[Key, ...], *, open_: bool = False) -> Self:
        """The document that says so."""
        return cls(keys=keys, open=open_, sha256=_checksum(keys, open_))


class KeyFile:
    """Reads and changes the keys file; commands that change it take turns."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def load(self) -> Document | None:
        """What the file says; None where there is none.

        Raises:
          KeysError: the file cannot be read, or is damaged.
        """
        try:
            return _parse(self.path.read_bytes(), self.path)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise KeysError(f"keys file {str(self.path)!r} cannot be read: {error.strerror}") from error

    def read(self) -> tuple[Key, ...]:
        """All keys, in the order of their creation; none where there is no file.

        Raises:
          KeysError: the file cannot be read, or is damaged.
        """
        document = self.load()
        return () if document is None else document.keys

    def create(self, project: str, name: str, scope: Scope) -> tuple[Key, str]:
        """Adds a key; returns it with the token that its holder needs. From now on everybody needs a key.

        Raises:
          KeysError: the file cannot be read, is damaged, or cannot be written.
        """
        with self._changing() as keys:
            return _add(keys, project, name, scope)

    def create_anew(self, project: str, name: str, scope: Scope) -> tuple[Key, str]:
        """The same as the first key of a new file, in place of one that is lost or damaged: others are worthless then.

        Raises:
          KeysError: the file is whole, or cannot be written.
        """
        with self._turn():
            if self._whole():
                raise KeysError(f"keys file {str(self.path)!r} is whole; wanted a lost or damaged one: `revoke` keys")
            keys: list[Key] = []
            made = _add(keys, project, name, scope)
            self._write(Document.of(tuple(keys)))
        return made

    def open_all(self) -> None:
        """Forgets all keys, also lost and damaged ones, and lets in every process of this machine without one.

        Raises:
          KeysError: the file cannot be written.
        """
        with self._turn():
            self._write(Document.of((), open_=True))

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

    def _whole(self) -> bool:
        """Whether there is a file and it is not damaged; one that may not be read raises, since nobody can know."""
        try:
            _parse(self.path.read_bytes(), self.path)
        except (FileNotFoundError, KeysError):
            return False
        return True

    @contextmanager
    def _changing(self) -> Iterator[list[Key]]:
        """The keys as a list whose changes are written, with nobody else changing them meanwhile."""
        with self._turn():
            keys = list(self.read())
            yield keys
            self._write(Document.of(tuple(keys)))

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """With nobody else changing the file meanwhile."""
        try:
            self.path.parent.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
            # A file of its own, because replacing the keys file would leave a lock on the old one.
            with self.path.with_suffix(".lock").open("ab") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                yield
        except OSError as error:
            raise KeysError(f"keys file {str(self.path)!r} cannot be written: {error.strerror}") from error

    def _write(self, document: Document) -> None:
        """Replaces the file; after a crash there is the old one or the new one, on disk and whole."""
        temporary = self.path.with_suffix(".tmp")
        temporary.unlink(missing_ok=True)
        with open(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(document.model_dump_json(indent=1, exclude_defaults=True).encode())
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(self.path)
        sync_folder(self.path.parent)


def _add(keys: list[Key], project: str, name: str, scope: Scope) -> tuple[Key, str]:
    key, token = mint(project, name, scope)
    while any(key.id == other.id for other in keys):
        key, token = mint(project, name, scope)
    keys.append(key)
    return key, token


def _parse(content: bytes, path: Path) -> Document:
    try:
        document = Document.model_validate_json(content)
    except ValidationError as error:
        raise KeysError(_unusable(path, "damaged")) from error
    if document.sha256 != _checksum(document.keys, document.open):
        raise KeysError(_unusable(path, "damaged"))
    return document


def missing(path: Path) -> KeysError:
    """What to raise where there is no file although keys were made."""
    return KeysError(_unusable(path, "missing, although keys were made"))


def _unusable(path: Path, how: str) -> str:
    return f"keys file {str(path)!r} is {how}; {REMEDY}, after which all earlier ones are worthless"


def _checksum(keys: tuple[Key, ...], open_: bool) -> str:
    return hashlib.sha256(to_json(keys) + (b"open" if open_ else b"")).hexdigest()
