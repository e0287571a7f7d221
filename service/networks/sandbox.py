"""Starting the checker, and what becomes of it. The server's side: it reads reports, never uploads."""

import logging
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from service.errors import StorageError
from service.networks.errors import UploadError
from service.networks.limits import LOG_BYTES, WALL_S
from service.networks.packaging import Packaging
from service.networks.report import CheckReport

logger = logging.getLogger(__name__)

# -I: neither the current folder nor the environment says what is imported.
CHECKER = (sys.executable, "-I", "-m", "service.networks.checker")
UPLOAD, LOG, REPORT = "upload", "log", "report"
_GRACE_S = 0.5  # for starting; the checker ends itself after WALL_S
_TOO_SLOW = (signal.SIGALRM, signal.SIGXCPU, signal.SIGKILL)
_REPORTS = TypeAdapter(CheckReport)


def inspect(
    folder: Path, packaging: Packaging, checker: Sequence[str] = CHECKER, wall_s: float = WALL_S
) -> CheckReport:
    """Check the file `upload` in a folder, in a process of its own, and wait for the report.

    Args:
      folder: where the checker works and leaves what it wrote anew.
      packaging: what the upload is.
      checker: the command.
      wall_s: how long it may take, s.

    Raises:
      UploadError: the upload is refused, cannot be checked in time, or breaks the simulator.
      StorageError: the checker cannot be started or cannot write.
    """
    try:
        status = _run([*checker, packaging], folder, wall_s + _GRACE_S)
        said = (folder / REPORT).read_bytes()[:LOG_BYTES]
    except OSError as error:
        raise StorageError(f"the upload cannot be checked ({error.strerror})") from error
    if status < 0:
        raise UploadError(_ended_by(-status, wall_s))
    try:
        report = _REPORTS.validate_json(said)
    except ValidationError as error:
        log = (folder / LOG).read_bytes()[-LOG_BYTES:].decode("utf-8", "backslashreplace")
        logger.error("the checker exited with status %d and said %r: %s", status, said[:200], log)
        raise StorageError(f"the upload cannot be checked (status {status}); the log has the reason") from error
    if report.refused is not None:
        raise UploadError(report.refused)
    return report


def _run(command: Sequence[str], folder: Path, patience_s: float) -> int:
    """Exit status of the checker; what it prints goes to files, so that it cannot fill our memory."""
    with (folder / REPORT).open("wb") as stdout, (folder / LOG).open("wb") as stderr:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env={"PATH": os.environ.get("PATH", os.defpath)},
            stdin=subprocess.DEVNULL,
            stdout=stdout,
            stderr=stderr,
            start_new_session=True,
        )
        try:
            return process.wait(patience_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return process.wait()


def _ended_by(number: int, wall_s: float) -> str:
    if number in _TOO_SLOW:
        return f"checking the upload takes more than {wall_s:g} s; wanted a smaller network"
    name = signal.Signals(number).name if number in list(signal.Signals) else f"signal {number}"
    return f"the simulator cannot load it: it was ended by {name}"
