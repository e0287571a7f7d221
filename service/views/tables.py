"""All episodes of a campaign in a format of other tools, made by a process of its own: the packages take 150 MB."""

import contextlib
import logging
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from risk_sac.execution.helper import ANSWER, run_helper
from risk_sac.failures.export.formats import FormatName
from risk_sac.run_folder.results import RESULTS
from service.errors import StorageError
from service.settings import ServiceSettings
from service.views.on_demand import OnDemandCache

logger = logging.getLogger(__name__)

WALL_S = 300.0  # a table of 100,000 episodes takes ten

KEPT = 1  # of some megabytes each


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


class Tables(OnDemandCache[Table]):
    """Makes them, one at a time; StorageError where one cannot be made, and the log has the reason."""

    def __init__(self, settings: ServiceSettings) -> None:
        super().__init__(self._written, "tables", KEPT)
        self._niceness, self._stopping = settings.worker_niceness, threading.Event()

    def stop(self) -> None:
        """Ends the one that is being made."""
        self._stopping.set()

    def _written(self, table: Table) -> bytes:
        arguments = ["export", *map(str, table.folders), "--format", table.format, "--out", ANSWER]
        try:
            result = run_helper(
                "risk_sac", arguments, wall_s=WALL_S, niceness=self._niceness, stopping=self._stopping.is_set
            )
        except OSError as error:
            raise StorageError(f"the table of episodes cannot be made ({error.strerror})") from error
        if result.status != 0:
            reason = f"more than {WALL_S:g} s" if result.timed_out else f"status {result.status}"
            logger.error("a table of episodes was not made (%s): %s", reason, result.log)
            raise StorageError("the table of episodes cannot be made; the log has the reason")
        return result.answer
