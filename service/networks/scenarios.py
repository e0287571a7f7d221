"""Scenarios of the service: shipped ones, and those that projects have posted.

Documents and nets lie in the library, under names that hold their digest. Beside it is a record for each project that
posted one. What reads a net runs in a process of its own.
"""

import base64
import json
import logging
import os
import secrets
import shutil
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from risk_sac.config import Scenario
from risk_sac.errors import ConfigError, DamagedError
from risk_sac.execution.helper import ANSWER, QUESTION, run_helper
from risk_sac.records.campaign import ScenarioCheck, ScenarioDetails, ScenarioSummary, summary_of
from risk_sac.run_folder.durable import replace_file
from risk_sac.scenario import library
from risk_sac.scenario.reading import scenario_file, shipped_document, shipped_names
from service.errors import BusyError, ConflictError, NotFoundError, StorageError, disk_refusals
from service.networks.schemas import MEMORY_BYTES, SCENARIO_S

logger = logging.getLogger(__name__)

HELPER = "service.networks.helper"
NICENESS = 5
AT_ONCE = 2
MOST_WAITING = 8
MOST = 200  # scenarios of one project
RETRY_AFTER_S = 5
PNG = b"\x89PNG"


class Scenarios:
    """Lists, checks, keeps, draws and deletes scenarios; used by many threads."""

    def __init__(self, folder: Path, places: Path, stopping: Callable[[], bool] = lambda: False) -> None:
        """Starts nothing.

        Args:
          folder: of the records, one below each project's name.
          places: the library.
          stopping: ends what is at work once it is true.
        """
        self._folder, self._places, self._stopping = folder, places, stopping
        self._turn, self._lock, self._waiting = threading.BoundedSemaphore(AT_ONCE), threading.Lock(), 0
        self._drawing, self._shipped = threading.Lock(), dict[str, bytes]()  # pictures of those that ship

    def list(self, project: str | None) -> list[ScenarioSummary]:
        """Returns shipped scenarios, then a project's (None: all), newest first."""
        own = dict[str, ScenarioSummary]()
        for record in self._records(project):
            try:
                own[record.name] = summary_of(record.name, library.kept(record.name)[0], _time(record))
            except (ConfigError, DamagedError, OSError) as error:
                logger.warning("scenario %s cannot be read: %s", record.name, error)
        newest = sorted(own.values(), key=lambda row: (row.created_at, row.name), reverse=True)
        return [*(summary_of(name, shipped_document(name)) for name in shipped_names()), *newest]

    def get(self, name: str, project: str | None) -> ScenarioDetails:
        """Returns a scenario with document; raises `NotFoundError` if the project lacks it."""
        if name in shipped_names():
            row, text = summary_of(name, shipped_document(name)), scenario_file(name).read_text()
        else:
            record = self._record(name, project)
            with self._unless_deleted(name, project):
                document = self._document(name)
                row, text = summary_of(name, document, _time(record)), library.written(document)
        return ScenarioDetails(**row.model_dump(), document=text)

    def add(self, upload: bytes, project: str, ego_entity: str = "") -> tuple[ScenarioDetails, bool]:
        """Keeps a document, or an archive.

        Args:
          upload: a document, an archive of it and its nets, or one of OpenSCENARIO.
          project: of the caller.
          ego_entity: entity of OpenSCENARIO that is the ego; empty: the one that is named so, or has a controller.

        Returns:
          The scenario, and whether it is new to the project.

        Raises:
          ConfigError: the document has faults, with their paths; nothing is stored.
          ConflictError: the project has as many scenarios as it may.
        """
        if sum(1 for _ in self._records(project)) >= MOST:
            said = f"project {project!r} has {MOST} scenarios; wanted fewer: delete one first"
            raise ConflictError(said, reason="too_many_scenarios")
        name = str(json.loads(self._run("add", upload, ego_entity))["name"])
        record = self._folder / project / name
        new = not record.exists()
        if new:
            with disk_refusals("a scenario cannot be stored"):
                record.parent.mkdir(parents=True, exist_ok=True)
                replace_file(record, datetime.now(UTC).isoformat().encode())
        return self.get(name, project), new

    def check(self, upload: bytes, ego_entity: str = "") -> ScenarioCheck:
        """Checks a document, plays 20 scenes, stores nothing; raises as `add`."""
        return ScenarioCheck.model_validate_json(self._run("check", upload, ego_entity))

    def picture(self, name: str) -> bytes:
        """Draws a scenario from `get`; raises `NotFoundError` if deleted meanwhile."""
        if name not in shipped_names():
            with self._unless_deleted(name, None):
                return self._run("picture", b"", name)
        with self._drawing:  # all at once: a process starts in three seconds, and draws one in a fifth of a second
            if not self._shipped:
                drawn = json.loads(self._run("pictures", b""))
                self._shipped = {each: base64.b64decode(content) for each, content in drawn.items()}
        return self._shipped[name]

    def delete(self, name: str, project: str | None, in_use: Callable[[], set[str]]) -> None:
        """Removes a project's scenario.

        Args:
          name: of the scenario.
          project: whose; None: of all projects.
          in_use: names that campaigns have.

        Raises:
          NotFoundError: the project has none of this name.
          ConflictError: it ships, or a campaign names it.
        """
        if name in shipped_names():
            raise ConflictError(f"{name} ships with the service; it cannot be deleted", reason="scenario_in_use")
        self._record(name, project)
        if name in in_use():
            raise ConflictError(
                f"a campaign names {name}; wanted none: delete its campaigns first", reason="scenario_in_use"
            )
        with disk_refusals("a scenario cannot be deleted"):
            for record in list(self._records(project)):
                if record.name == name:
                    record.unlink(missing_ok=True)
            if name not in self.names():
                grave = self._places / f".gone-{name}-{secrets.token_hex(4)}"
                (self._places / name).rename(grave)
                shutil.rmtree(grave)

    def names(self) -> set[str]:
        """Names that any project has posted, which the library must not lose."""
        return {record.name for record in self._records(None)}

    def _document(self, name: str) -> Scenario:
        with disk_refusals("a scenario cannot be read"):
            return library.kept(name)[0]

    def _records(self, project: str | None) -> Iterator[Path]:
        homes = self._folder.glob("[!.]*") if project is None else [self._folder / project]
        return (path for home in homes if home.is_dir() for path in home.glob("[!.]*"))

    def _record(self, name: str, project: str | None) -> Path:
        for record in self._records(project):
            if record.name == name:
                return record
        raise NotFoundError(f"there is no scenario {name!r}", field="scenario", got=name)

    @contextmanager
    def _unless_deleted(self, name: str, project: str | None) -> Iterator[None]:
        """Turns a reading error into `NotFoundError` if the scenario was deleted."""
        try:
            yield
        except (ConfigError, DamagedError, StorageError, OSError):
            self._record(name, project)
            raise

    def _run(self, action: str, upload: bytes, *arguments: str) -> bytes:
        with self._lock:
            if self._waiting >= MOST_WAITING:
                said = f"{MOST_WAITING} scenarios are checked or drawn; wanted fewer: try again in {RETRY_AFTER_S} s"
                raise BusyError(said, RETRY_AFTER_S)
            self._waiting += 1
        too_slow = ("", f"one whose check takes more than {SCENARIO_S} s", "a shorter horizon or a smaller network")
        try:
            with self._turn:
                return ask_helper(
                    (action, *arguments),
                    self._places,
                    "the scenario cannot be checked",
                    too_slow,
                    wall_s=SCENARIO_S,
                    question=upload,
                    environment=os.environ,
                    stopping=self._stopping,
                )
        finally:
            with self._lock:
                self._waiting -= 1


def ask_helper(
    arguments: Sequence[str],
    places: Path,
    failing: str,
    too_slow: tuple[str, str, str],
    *,
    environment: Mapping[str, str],
    **how: Any,
) -> bytes:
    """Returns what `service.networks.helper` answers.

    Args:
      arguments: its action, and what that takes.
      places: the library.
      failing: begins the message of a StorageError.
      too_slow: field, got and expected of the ConfigError where it takes too long.
      environment: of the process, beside what it needs itself.
      how: as `run_helper` takes it.

    Raises:
      ConfigError: it refuses the question, or takes too long.
      StorageError: it cannot be started, has met damage, or ended without an answer.
    """
    own = {library.VARIABLE: str(places.absolute()), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with disk_refusals(failing):
        places.mkdir(parents=True, exist_ok=True)
        result = run_helper(
            HELPER,
            [QUESTION, ANSWER, *arguments],
            memory_bytes=MEMORY_BYTES,
            niceness=NICENESS,
            environment={**environment, **own},
            **how,
        )
    if result.timed_out:
        raise ConfigError(*too_slow)
    if not result.answer:
        logger.error("the helper ended with status %d: %s", result.status, result.log)
        raise StorageError(f"{failing} ({result.reason})")
    return result.answer if result.answer.startswith(PNG) else _accepted(result.answer)


def _accepted(content: bytes) -> bytes:
    report = json.loads(content)
    if not report.keys() & {"faults", "damaged"}:
        return content
    if "damaged" in report:
        raise StorageError(str(report["damaged"]))
    first, *others = (ConfigError(*fault) for fault in report["faults"])
    first.others = tuple(others)
    raise first


def _time(record: Path) -> datetime:
    return datetime.fromisoformat(record.read_text())
