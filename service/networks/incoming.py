"""An upload while it arrives, in a folder of its own that nobody else knows of."""

import hashlib
import shutil
from pathlib import Path

from service.errors import StorageError
from service.networks.packaging import SNIFFED_BYTES, Packaging, sniff
from service.networks.sandbox import LOG, UPLOAD


class Incoming:
    """Writes an upload down as it comes; closing it is for whoever opened it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.bytes = 0
        self._start = b""
        self._hash = hashlib.sha256()
        self._file = (folder / UPLOAD).open("wb")

    def write(self, chunk: bytes) -> None:
        """One more piece of the upload.

        Raises:
          StorageError: the disk refuses.
        """
        self.bytes += len(chunk)
        self._start += chunk[: SNIFFED_BYTES - len(self._start)]
        self._hash.update(chunk)
        try:
            self._file.write(chunk)
        except OSError as error:
            raise StorageError(f"an upload cannot be received ({error.strerror})") from error

    def complete(self, packaging: Packaging) -> str:
        """SHA-256 of the upload, now that it is there.

        Raises:
          UploadError: it is not what it is called.
          OSError: the disk refuses.
        """
        self._file.close()
        sniff(self._start, packaging)
        return self._hash.hexdigest()

    def strip(self) -> None:
        """Leave only what the checker wrote anew."""
        for name in (UPLOAD, LOG):
            (self.folder / name).unlink()

    def discard(self) -> None:
        """Remove whatever is still there."""
        self._file.close()
        shutil.rmtree(self.folder, ignore_errors=True)
