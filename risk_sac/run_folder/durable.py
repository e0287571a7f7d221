"""Files that survive crashes: replaced in one step, locked and sealed."""

import contextlib
import fcntl
import hashlib
import logging
import os
import re
import secrets
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import IO, Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from risk_sac.errors import ConfigError, DamagedError
from risk_sac.host.machine import NO_LOCKS, UNWRITABLE

_SCRATCH = re.compile(r"risk-sac\.[0-9a-f]{16}\.scratch")
# Files that `durable.replace_file` writes into folders of ours, before they get their names.
_TEMPORARY = re.compile(
    r"\.(?:(?:results|verified|crashes|keys|table|places)\.(?:json|md|csv)|spec\.yaml|checkpoint|\d{6}\.npz"
    r"|\d{6}-(?:core|region)\.json|[A-Za-z0-9]+-[0-9a-f]{16}\.json|places\.png|boundary\.(?:json|png))\.tmp|\.probe"
)


def scratch_name() -> str:
    """Returns a new name by which `claim` knows a folder as ours."""
    return f"risk-sac.{secrets.token_hex(8)}.scratch"


@contextlib.contextmanager
def scratch_folder() -> Iterator[Path]:
    """Makes a temporary folder and removes it at the end.

    If this process is killed, the next one removes it.
    """
    folder = Path(tempfile.gettempdir(), scratch_name())
    handle = claim(folder)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(handle)


def remove_abandoned(parent: Path) -> None:
    """Removes folders made by `claim` in `parent` whose processes have gone."""
    for folder in parent.iterdir():
        if _SCRATCH.fullmatch(folder.name):
            with contextlib.suppress(OSError):  # its process lives, or it is another user's
                handle = _locked(folder)
                shutil.rmtree(folder, ignore_errors=True)
                os.close(handle)


def claim(folder: Path) -> int:
    """Makes a folder named by `scratch_name`; removes abandoned ones beside it.

    Returns the descriptor that locks it; the kernel unlocks it when the process dies.
    """
    remove_abandoned(folder.parent)
    while True:
        folder.mkdir(mode=0o700, exist_ok=True)
        try:
            handle = _locked(folder)
            if folder.exists():
                return handle
            os.close(handle)
        except (BlockingIOError, FileNotFoundError):  # another process is just removing it
            time.sleep(0.01)
        except OSError as error:
            if error.errno not in NO_LOCKS:
                raise
            return os.open(folder, os.O_RDONLY)  # then no other process can take it for abandoned


def _locked(folder: Path) -> int:
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        os.close(handle)
        raise
    return handle


def remove_temporaries(folder: Path, before: float) -> None:
    """Removes our temporary files below a folder that are older than `before`.

    They were last written before that moment, s since the epoch.
    """
    for parent, _, names in os.walk(folder):
        for name in filter(_TEMPORARY.fullmatch, names):
            with contextlib.suppress(OSError):
                file = Path(parent, name)
                if file.stat().st_mtime < before:
                    file.unlink()


logger = logging.getLogger(__name__)

T = TypeVar("T")
_SEAL = re.compile(rb',\n  "sha256": "([0-9a-f]{64})"\n}\n\Z')
_END = b"\n}"
LOCK = ".lock"  # lock file of a folder that one process at a time may work in


def replace_file(
    path: Path, content: bytes | memoryview | Iterator[bytes], *, keep: Path | None = None, mode: int = 0o666
) -> None:
    """Replaces a file in one step.

    A crash or a full disk leaves the old file or the new one.

    Args:
      path: in an existing folder; it has one writer at a time.
      content: of the new file, or its pieces.
      keep: where the old file goes; at every moment there is a whole one at `path` or at `keep`.
      mode: of the new file, before the process's umask.

    Raises:
      OSError: the folder is missing, unwritable or full; an old file stays as it was.
    """
    temporary = path.with_name(f".{path.name}.tmp")  # same folder: a rename across file systems is not atomic
    try:
        temporary.unlink(missing_ok=True)
        with open(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
            file.writelines(content if isinstance(content, Iterator) else [content])
            file.flush()
            os.fsync(file.fileno())
        if keep is not None and path.exists():
            path.replace(keep)
        temporary.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Makes the renames in a folder survive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def lock(path: Path, *, wait: bool = False) -> IO[bytes]:
    """Locks a file, creating it if missing; closing the file unlocks it.

    The kernel unlocks it when the process dies.

    Raises:
      BlockingIOError: another process has locked it, and this one does not wait.
      OSError: it cannot be opened or locked.
    """
    file = path.open("ab")
    try:
        fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        file.close()
        raise
    return file


@contextlib.contextmanager
def held(folder: Path) -> Iterator[None]:
    """Makes a folder of results and locks it against other processes.

    Raises:
      ConfigError: another process works in it, or it cannot be written.
      OSError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = lock(folder / LOCK)
    except BlockingIOError as error:
        expected = "a folder that no other process is using"
        raise ConfigError("out", f"{folder}, in which another process is at work", expected) from error
    except OSError as error:
        if error.errno in UNWRITABLE:
            got = f"{folder}, which cannot be written ({error.strerror})"
            raise ConfigError("out", got, "a folder that can be written") from error
        if error.errno not in NO_LOCKS:
            raise
        logger.warning("%s cannot be locked (%s); let no other process work in it", folder, error.strerror)
        yield
        return
    with file:
        remove_temporaries(folder, time.time())
        yield


def set_aside(path: Path) -> Path:
    """Renames a damaged file so that nothing reads it; returns its path."""
    return path.replace(path.with_name(f"{path.name}.damaged"))


def sha256(path: Path) -> str | None:
    """Returns the hexadecimal SHA-256 of a file; None if unreadable."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None


def write_sealed(path: Path, document: object, *, mode: int = 0o666) -> None:
    """Replaces a sealed file in one step, as `replace_file` does."""
    replace_file(path, seal(document), mode=mode)


def read_sealed(path: Path, kind: type[T]) -> T:
    """Reads a file of `write_sealed`; raises `DamagedError` if it has changed."""
    try:
        return unseal(path.read_bytes(), kind)
    except DamagedError as error:
        raise DamagedError(f"{path} is damaged: {error}") from error


def seal(document: Any) -> bytes:
    """Returns a model, dataclass or dict, not empty, as sealed JSON."""
    kind: Any = type(document)
    text = _adapter(kind).dump_json(document, indent=2)
    return text.removesuffix(_END) + f',\n  "sha256": "{hashlib.sha256(text).hexdigest()}"\n}}\n'.encode()


def sealed_pieces(document: Any, rows: Iterable[Any]) -> Iterator[bytes]:
    """Yields a sealed document with these rows, one at a time.

    The document's last field, which is empty, gets the rows; all together is what `seal` returns.
    """
    kind: Any = type(document)
    piece = _adapter(kind).dump_json(document, indent=2).removesuffix(b"[]" + _END)
    digest, before = hashlib.sha256(piece), b"["
    yield piece
    for row in rows:
        kind = type(row)
        piece = before + b"\n    " + _adapter(kind).dump_json(row, indent=2).replace(b"\n", b"\n    ")
        before = b","
        digest.update(piece)
        yield piece
    piece = b"[]" if before == b"[" else b"\n  ]"
    digest.update(piece + _END)
    yield piece + f',\n  "sha256": "{digest.hexdigest()}"\n}}\n'.encode()


def unseal(content: bytes, kind: type[T]) -> T:
    """Returns the document that was sealed; raises `DamagedError` if changed."""
    seal_match = _SEAL.search(content)
    if seal_match is None:
        raise DamagedError("it does not end in its SHA-256: it was cut short, or something else wrote it")
    text = content[: seal_match.start()] + _END
    actual, wanted = hashlib.sha256(text).hexdigest(), seal_match[1].decode()
    if actual != wanted:
        raise DamagedError(f"its SHA-256 is {actual}, wanted {wanted}")
    try:
        document: T = _adapter(kind).validate_json(text)  # type: ignore[arg-type] # a class is hashable
    except ValidationError as error:
        raise DamagedError(f"it holds something else: {error.errors()[0]['msg']}") from error
    return document


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)
