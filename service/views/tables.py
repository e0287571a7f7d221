"""All episodes of a campaign in a format of other tools, made by a process of its own: the packages take 150 MB."""

import contextlib
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from risk_sac.execution.helper import ANSWER
from risk_sac.failures.export.formats import FormatName
from risk_sac.run_folder.results import RESULTS
from service.errors import StorageError
from service.views.on_demand import WALL_S, Helper, OnDemandCache

logger = logging.getLogger(__name__)

KEPT = 1  # of some megabytes each


@dataclass(frozen=True, slots=True)
class Table:
    """The episodes in folders of runs, as they are at a time."""

    folders: tuple[Path, ...]
    written_ns: tuple[int, ...]
    """When the results of each run were."""
    format: FormatName

    @classmethod
    def of(cls, folders: Sequence[Path], format: FormatName) -> "Table":
        """The table of those runs that have results by now."""
        written_ns = {}
        for folder in folders:
            with contextlib.suppress(FileNotFoundError):
                written_ns[folder] = (folder / RESULTS).stat().st_mtime_ns
        return cls(tuple(written_ns), tuple(written_ns.values()), format)


class Tables(OnDemandCache[Table]):
    """Tables, made one at a time; StorageError where one cannot be made."""

    def __init__(self, helper: Helper) -> None:
        super().__init__(self._written, "tables", KEPT)
        self._helper = helper

    def _written(self, table: Table) -> bytes:
        folders = map(str, table.folders)
        result = self._helper.run("risk_sac", ["export", *folders, "--format", table.format, "--out", ANSWER])
        if result.status != 0:
            reason = f"more than {WALL_S:g} s" if result.timed_out else f"status {result.status}"
            logger.error("a table of episodes was not made (%s): %s", reason, result.log)
            raise StorageError("the table of episodes cannot be made; the log has the reason")
        return result.answer
