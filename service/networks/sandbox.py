"""Receives uploads and starts the checker; this process parses reports, never uploads."""

import hashlib
import logging
import os
import shutil
import signal
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from risk_sac.execution.helper import ANSWER, run_helper
from service.errors import StorageError, UploadError
from service.networks.limits import LOG_BYTES, WALL_S
from service.networks.report import CheckReport

logger = logging.getLogger(__name__)

CHECKER = "service.networks.checker"
UPLOAD, LOG = "upload", "log"
_GRACE_S = 0.5  # for starting; the checker ends itself after WALL_S
_TOO_SLOW = (signal.SIGALRM, signal.SIGXCPU, signal.SIGKILL)
_REPORTS = TypeAdapter(CheckReport)


class Incoming:
    """Upload that is written to disk as it arrives; its opener closes it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.bytes = 0
        self._hash = hashlib.sha256()
        self._file = (folder / UPLOAD).open("wb")

    def write(self, chunk: bytes) -> None:
        """Writes one more piece of the upload."""
        self.bytes += len(chunk)
        self._hash.update(chunk)
        try:
            self._file.write(chunk)
        except OSError as error:
            raise StorageError(f"an upload cannot be received ({error.strerror})") from error

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
    """Checks the file `upload` of a folder in a separate process and returns its report."""
    try:
        result = run_helper(
            checker,
            [ANSWER],
            wall_s=wall_s + _GRACE_S,
            isolated=True,
            cwd=folder,
            environment={"PATH": os.environ.get("PATH", os.defpath)},
            log=folder / LOG,
        )
    except OSError as error:
        raise StorageError(f"the upload cannot be checked ({error.strerror})") from error
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
