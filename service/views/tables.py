"""All episodes of a campaign in a format of other tools, made by a process of its own: the packages take 150 MB."""

import contextlib
import logging
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from risk_sac.failures.export.formats import FormatName
from risk_sac.run_folder.results import RESULTS
from service.errors import StorageError
from service.settings import ServiceSettings
from service.views.asides import Aside
from service.views.products import Products

logger = logging.getLogger(__name__)

KEPT = 1  # of some megabytes; the newest, for those who ask for it at once


@dataclass(frozen=True, slots=True)
class Table:
    """What is made: the episodes in folders of runs, as they are at a time."""

    folders: tuple[Path, ...]
    written_ns: tuple[int, ...]
    """When the results of each run were."""
    format: FormatName

    @classmethod
    def of(cls, folders: Sequence[Path], format: FormatName) -> "Table":
        """Of those that have results by now, which may be none."""
        written_ns = {}
        for folder in folders:
            with contextlib.suppress(FileNotFoundError):
                written_ns[folder] = (folder / RESULTS).stat().st_mtime_ns
        return cls(tuple(written_ns), tuple(written_ns.values()), format)


class Tables(Products[Table]):
    """Makes them, one at a time; StorageError where one cannot be made, and the log has the reason."""

    def __init__(self, settings: ServiceSettings) -> None:
        super().__init__(self._written, "tables", KEPT)
        self._aside = Aside(settings)

    def stop(self) -> None:
        """Ends the one that is being made."""
        self._aside.stop()

    def _written(self, table: Table) -> bytes:
        with tempfile.TemporaryDirectory() as scratch, tempfile.TemporaryFile() as log:
            file = Path(scratch) / table.format
            arguments = ["export", *map(str, table.folders), "--format", table.format, "--out", str(file)]
            try:
                if (status := self._aside.run("risk_sac", arguments, log)) == 0:
                    return file.read_bytes()
                reason = f"status {status}"
            except subprocess.TimeoutExpired as error:
                reason = str(error)
            except OSError as error:
                raise StorageError(f"the table of episodes cannot be made ({error.strerror})") from error
            log.seek(0)
            tail = log.read()[-2000:].decode(errors="replace")
            logger.error("a table of episodes was not made (%s): %s", reason, tail)
        raise StorageError("the table of episodes cannot be made; the log has the reason")
