"""The keys on disk: one small file, replaced as a whole."""

import contextlib
import fcntl
import hashlib
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import to_json

from risk_sac.errors import DamagedError
from risk_sac.run_folder.durable import unseal, write_sealed
from service.errors import KeysError
from service.host.data_folder import FILE_MODE, FOLDER_MODE
from service.keys.key import Key, Scope, mint

REMEDY = "restore their file from a copy, or begin anew with `risk-sac keys create --anew`"


class Document(BaseModel):
    """Content of the file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    keys: tuple[Key, ...]
    open: bool = False
    """Whether processes of this machine need no key, because an administrator said so."""


class _UnsealedDocument(Document):
    """The file as version 0.1 wrote it, with a checksum over the keys."""

    sha256: str

    def whole(self) -> bool:
        content = to_json(self.keys) + (b"open" if self.open else b"")
        return hashlib.sha256(content).hexdigest() == self.sha256


class KeyFile:
    """Reads and changes the keys file; commands that change it take turns."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def load(self) -> Document | None:
        """Reads the file; None where there is none. Raises a KeysError if it is damaged."""
        try:
            return _parse(self.path.read_bytes(), self.path)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise KeysError(f"keys file {str(self.path)!r} cannot be read: {error.strerror}") from error

    def read(self) -> tuple[Key, ...]:
        """Returns all keys, in the order of their creation; none where there is no file."""
        document = self.load()
        return () if document is None else document.keys

    def create(self, project: str, name: str, scope: Scope) -> tuple[Key, str]:
        """Adds a key; returns it with the token that its holder needs. From now on every caller needs a key."""
        with self._changing() as keys:
            return _add(keys, project, name, scope)

    def create_anew(self, project: str, name: str, scope: Scope) -> tuple[Key, str]:
        """Makes the first key of a new file in place of a lost or damaged one; refuses to replace a whole one."""
        with self._turn():
            if self._whole():
                raise KeysError(f"keys file {str(self.path)!r} is whole; wanted a lost or damaged one: `revoke` keys")
            keys: list[Key] = []
            made = _add(keys, project, name, scope)
            self._write(Document(keys=tuple(keys)))
        return made

    def open_all(self) -> None:
        """Forgets all keys, also lost and damaged ones, and lets in every process of this machine without one."""
        with self._turn():
            self._write(Document(keys=(), open=True))

    def revoke(self, key_id: str) -> Key:
        """Makes a key worthless; does nothing to one that is already."""
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
            self._write(Document(keys=tuple(keys)))

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
        write_sealed(self.path, document, mode=FILE_MODE)


def _add(keys: list[Key], project: str, name: str, scope: Scope) -> tuple[Key, str]:
    key, token = mint(project, name, scope)
    while any(key.id == other.id for other in keys):
        key, token = mint(project, name, scope)
    keys.append(key)
    return key, token


def _parse(content: bytes, path: Path) -> Document:
    try:
        return unseal(content, Document)
    except DamagedError as error:
        with contextlib.suppress(ValidationError):
            old = _UnsealedDocument.model_validate_json(content)
            if old.whole():
                return Document(keys=old.keys, open=old.open)
        raise KeysError(_unusable(path, "damaged")) from error


def missing(path: Path) -> KeysError:
    """What to raise where there is no file although keys were made."""
    return KeysError(_unusable(path, "missing, although keys were made"))


def _unusable(path: Path, how: str) -> str:
    return f"keys file {str(path)!r} is {how}; {REMEDY}, after which all earlier ones are worthless"
