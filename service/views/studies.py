"""Studies of a failure and tables of episodes from helper processes.

A study needs the simulator; a table needs packages of 150 MB.
"""

import contextlib
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from risk_sac.config import EgoConfig
from risk_sac.errors import ConfigError
from risk_sac.execution.helper import ANSWER, QUESTION
from risk_sac.execution.messages import without_folders
from risk_sac.failures.export.formats import FormatName
from risk_sac.failures.question import IDLE, REFUSED, Question, Subject, Twin
from risk_sac.failures.studied import valid_failure
from risk_sac.run_folder.results import RESULTS
from service.errors import NotPlayable, OutdatedError, StorageError
from service.settings import ServiceSettings
from service.views.on_demand import WALL_S, Helper, OnDemandCache
from service.views.series import FailureOfARun, load_arrays, series_file

logger = logging.getLogger(__name__)

MISUSED = 2  # exit status of `risk-sac` for what cannot be used
STUDIES_AT_ONCE = 2  # the long ones of one key hold up no other key
TABLES_KEPT = 1  # of some megabytes each


@dataclass(frozen=True, slots=True)
class Study:
    """A question about a failure."""

    failure: FailureOfARun
    subject: Subject
    twin: Twin | None = None
    """Of a twin: which."""
    format: FormatName | None = None
    """Of an export: which."""


class Studies(OnDemandCache[Study]):
    """Makes studies, one of a key at a time; raises SeriesLost or NotPlayable."""

    def __init__(self, settings: ServiceSettings, helper: Helper) -> None:
        super().__init__(self._answer, "failures", at_once=STUDIES_AT_ONCE)
        self._settings, self._helper = settings, helper

    async def get(self, subject: Study, key_id: str | None) -> bytes:
        """Returns the study; what cannot be minimised or has no region is refused at once."""
        if subject.subject in ("core", "most-plausible", "region"):
            episode = subject.failure.episode
            try:
                valid_failure(episode.id, episode)
            except ConfigError as error:
                raise NotPlayable(error.got) from error
        return await super().get(subject, key_id)

    def _answer(self, study: Study) -> bytes:
        failure = study.failure
        path, sha256 = series_file(failure.campaign.id, failure.stored, self._settings)
        load_arrays(path, sha256)  # raises where it is lost or damaged
        try:
            spec = failure.campaign.run_spec(failure.run)
        except OutdatedError as error:
            raise NotPlayable(str(error)) from error
        question = Question(
            subject=study.subject,
            spec=spec,
            episode=failure.episode,
            series=path,
            format=study.format,
            twin=None if study.twin in (None, IDLE) else EgoConfig.model_validate({"profile": study.twin}),
        )
        asked = question.model_dump_json().encode()
        result = self._helper.run("risk_sac.failures.study", [QUESTION, ANSWER], asked)
        if result.timed_out:
            raise NotPlayable(f"it takes more than {WALL_S:g} s here")
        if result.status == REFUSED:
            raise NotPlayable(without_folders(result.answer.decode(errors="replace"), path.parent))
        if result.status != 0:
            logger.error("a study ended with status %d: %s", result.status, result.log)
            raise NotPlayable("its process was lost; the log has the reason")
        return result.answer


@dataclass(frozen=True, slots=True)
class EpisodeTable:
    """The episodes in folders of runs, as they are at a time."""

    folders: tuple[Path, ...]
    written_ns: tuple[int, ...]
    """When the results of each run were."""
    format: FormatName

    @classmethod
    def of(cls, folders: Sequence[Path], format: FormatName) -> "EpisodeTable":
        """The table of those runs that have results by now."""
        written_ns = {}
        for folder in folders:
            with contextlib.suppress(FileNotFoundError):
                written_ns[folder] = (folder / RESULTS).stat().st_mtime_ns
        return cls(tuple(written_ns), tuple(written_ns.values()), format)


class EpisodeTables(OnDemandCache[EpisodeTable]):
    """Tables, made one at a time; StorageError where one cannot be made."""

    def __init__(self, helper: Helper) -> None:
        super().__init__(self._written, "tables", TABLES_KEPT)
        self._helper = helper

    def _written(self, table: EpisodeTable) -> bytes:
        folders = map(str, table.folders)
        result = self._helper.run("risk_sac", ["export", *folders, "--format", table.format, "--out", ANSWER])
        if result.status != 0:
            logger.error("a table of episodes was not made (status %d): %s", result.status, result.log)
            reason = f"it takes more than {WALL_S:g} s" if result.timed_out else "the log has the reason"
            for folder in table.folders:  # a file of a run may be damaged or gone
                if result.status == MISUSED and f"{folder}/" in result.log:
                    reason = f"run {folder.name}: " + result.log.partition(f"{folder}/")[2].splitlines()[0]
            rest = "`episodes` of the campaign still lists them all"
            raise StorageError(f"the table of episodes cannot be made: {without_folders(reason)}; {rest}")
        return result.answer
