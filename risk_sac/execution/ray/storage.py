"""The files of an attempt between its node and the server: each whole or not there, with its SHA-256, by fsspec.

ROOT/<attempt>-<token>/fence            is there as long as anybody wants what this attempt writes
ROOT/<attempt>-<token>/blobs/<sha256>   a file
ROOT/<attempt>-<token>/manifest.json    name -> SHA-256 of all files at one moment; sealed, and written after them
ROOT/<attempt>-<token>/seed.json        the same of what the attempt begins with; the server writes it
ROOT/<attempt>-<token>/beside.json      the same of what its worker reads beside the run's folder

An attempt writes to its own folder alone, so that one that was given up can do no harm.
"""

import contextlib
import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import fsspec

from risk_sac.errors import DamagedError
from risk_sac.run_folder.durable import replace_file, seal, unseal

FENCE, BLOBS, MANIFEST, SEED, BESIDE = "fence", "blobs", "manifest.json", "seed.json", "beside.json"
OWN = ".attempts"  # in a run's folder, where the storage is that folder
KEY = ".storage-key"

Manifest = Mapping[str, str]


def root_of(url: str | None, folder: Path) -> str:
    """Where the attempts at a run exchange files.

    Args:
      url: of the storage; None for the run's own folder.
      folder: of the run; gets a file that names it among all that share the storage.
    """
    if url is None:
        return f"file://{folder.resolve() / OWN}"
    file = folder / KEY
    if not file.exists():
        replace_file(file, os.urandom(8).hex().encode())
    return f"{url.rstrip('/')}/{folder.name}-{file.read_text()}"


def without_secrets(url: str) -> str:
    """A URL that anybody may read."""
    parts = urlsplit(url)
    return parts._replace(netloc=parts.netloc.rpartition("@")[2], query="").geturl()


class Place:
    """A folder of a storage. All of its methods raise OSError where the storage refuses."""

    def __init__(self, url: str) -> None:
        self._files, self._path = fsspec.core.url_to_fs(url)
        self._local = self._files.protocol == "file" or "file" in self._files.protocol
        # A listing that was kept from before would show what others have removed since.
        self._files.use_listings_cache = False

    def write(self, name: str, content: bytes) -> None:
        """Writes a file whole or not at all."""
        path = f"{self._path}/{name}"
        with _as_os_error():
            if self._local:
                Path(path).parent.mkdir(parents=True, exist_ok=True)
                replace_file(Path(path), content)
            else:
                self._files.pipe_file(path, content)  # an object appears when all of it is there

    def read(self, name: str) -> bytes:
        """Reads a file; FileNotFoundError if there is none."""
        with _as_os_error():
            content: bytes = self._files.cat_file(f"{self._path}/{name}")
            return content

    def has(self, name: str) -> bool:
        """Whether there is such a file."""
        with _as_os_error():
            self._files.invalidate_cache()
            return bool(self._files.exists(f"{self._path}/{name}"))

    def remove(self, name: str = "") -> None:
        """Removes a file, or a folder with all that is in it; there may be none."""
        path = f"{self._path}/{name}".rstrip("/")
        with _as_os_error(), contextlib.suppress(FileNotFoundError):
            self._files.invalidate_cache()
            self._files.rm(path, recursive=True)

    def names(self) -> list[str]:
        """Of what lies directly in it."""
        with _as_os_error():
            try:
                self._files.invalidate_cache()
                return sorted(path.rstrip("/").rpartition("/")[2] for path in self._files.ls(self._path, detail=False))
            except FileNotFoundError:
                return []

    def put(self, content: bytes) -> str:
        """Writes a blob; returns its SHA-256."""
        digest = hashlib.sha256(content).hexdigest()
        self.write(f"{BLOBS}/{digest}", content)
        return digest

    def get(self, digest: str) -> bytes:
        """Reads a blob.

        Raises:
          DamagedError: it is not what was written.
        """
        content = self.read(f"{BLOBS}/{digest}")
        found = hashlib.sha256(content).hexdigest()
        if found != digest:
            raise DamagedError(f"a file of the storage is damaged: its SHA-256 is {found}, wanted {digest}")
        return content

    def write_manifest(self, name: str, manifest: Manifest) -> None:
        """Says which blobs belong together."""
        self.write(name, seal({"files": dict(manifest)}))

    def read_manifest(self, name: str) -> Manifest | None:
        """Which blobs belong together; None if nobody has said so yet.

        Raises:
          DamagedError: what was said is damaged.
        """
        try:
            content: dict[str, Any] = unseal(self.read(name), dict)
        except FileNotFoundError:
            return None
        files: Manifest = content["files"]
        return files


class Publisher:
    """Brings what changes in a folder of this node into the storage."""

    def __init__(self, folder: Path, place: Place) -> None:
        self._folder = folder
        self._place = place
        self._seen: dict[str, tuple[int, int, int]] = {}
        self._manifest: dict[str, str] = {}
        self._before: dict[str, str] = {}

    def changed(self) -> tuple[list[str], list[str]]:
        """Files that are new or were replaced, and those that have only been written to."""
        new: list[str] = []
        written: list[str] = []
        for name, signature in _files(self._folder).items():
            seen = self._seen.get(name)
            if seen != signature:
                (new if seen is None or seen[0] != signature[0] else written).append(name)
        return new, written

    def publish(self, names: list[str]) -> None:
        """Brings files into the storage, and then the news of them."""
        manifest, seen = dict(self._manifest), {}
        for name in names:
            path = self._folder / name
            with contextlib.suppress(FileNotFoundError):  # replaced or removed just now; the next look finds it
                signature = _signature(path)
                manifest[name] = self._place.put(path.read_bytes())
                seen[name] = signature
        there = _files(self._folder)
        manifest = {name: digest for name, digest in manifest.items() if name in there}
        self._place.write_manifest(MANIFEST, manifest)
        # The manifest before may be being read.
        for digest in set(self._before.values()) - {*self._manifest.values(), *manifest.values()}:
            self._place.remove(f"{BLOBS}/{digest}")
        self._before, self._manifest = self._manifest, manifest
        self._seen |= seen


def adopt(place: Place, name: str, folder: Path, known: dict[str, str]) -> None:
    """Brings the files of a manifest into a folder of this machine.

    Args:
      place: of the attempt.
      name: of the manifest.
      folder: for the files; what else it holds stays.
      known: SHA-256 of files that are there already, which is kept up to date.

    Raises:
      OSError: the storage or the disk refuses.
      DamagedError: a file is damaged.
    """
    for _ in range(3):  # a newer manifest may take files away while this one is read
        manifest = place.read_manifest(name) or {}
        try:
            for file, digest in manifest.items():
                if known.get(file) != digest:
                    path = folder / file
                    path.parent.mkdir(parents=True, exist_ok=True)
                    replace_file(path, place.get(digest))
                    known[file] = digest
        except FileNotFoundError:
            continue
        return
    raise OSError(f"files of {name} are gone from the storage")


def sow(place: Place, name: str, files: Mapping[str, Path]) -> None:
    """Gives an attempt files of this machine, by a manifest of their own; none without any.

    Raises:
      OSError: the storage refuses, or a file cannot be read.
    """
    if files:
        place.write_manifest(name, {file: place.put(path.read_bytes()) for file, path in files.items()})


def files_in(folder: Path) -> dict[str, Path]:
    """All files of a folder that an attempt may read or write, by their path in it."""
    return {name: folder / name for name in _files(folder)}


def _files(folder: Path) -> dict[str, tuple[int, int, int]]:
    """All files of a folder, by their path in it, with what changes when they do."""
    found = {}
    for parent, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name != OWN]
        for name in names:
            path = Path(parent, name)
            if not name.endswith(".tmp") and name != ".lock":
                with contextlib.suppress(FileNotFoundError):
                    found[str(path.relative_to(folder))] = _signature(path)
    return found


def _signature(path: Path) -> tuple[int, int, int]:
    status = path.stat()
    return status.st_ino, status.st_size, status.st_mtime_ns


@contextlib.contextmanager
def _as_os_error() -> Any:
    """Storages have errors of their own, of any class; for us they are what a disk says."""
    try:
        yield
    except OSError:
        raise
    except Exception as error:
        raise OSError(f"{type(error).__name__}: {error}") from error
