"""What takes the simulator to say of a failure: asked of a process of its own, see `risk_sac.failures.study`."""

import logging
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from risk_sac.config import EgoConfig
from risk_sac.execution.postmortem import without_folders
from risk_sac.failures.export.formats import FormatName
from risk_sac.failures.question import IDLE, REFUSED, Question, Subject, Twin
from service.errors import OutdatedError, ServiceError, StorageError
from service.settings import ServiceSettings
from service.views.asides import WALL_S, Aside
from service.views.bodies import series_file
from service.views.pictures import ContactOfARun
from service.views.products import Products
from service.views.series import load_arrays

logger = logging.getLogger(__name__)


class CannotBePlayed(ServiceError):
    """The failure does not repeat here, or cannot be played as was asked."""


@dataclass(frozen=True, slots=True)
class Study:
    """What is asked of which contact."""

    contact: ContactOfARun
    subject: Subject
    twin: Twin | None = None
    """Of a twin, which."""
    format: FormatName | None = None
    """Of an export, which."""


class Studies(Products[Study]):
    """Answers, one at a time; StorageError where the time series is lost, CannotBePlayed where nothing can be said."""

    def __init__(self, settings: ServiceSettings) -> None:
        super().__init__(self._answer, "failures")
        self._settings, self._aside = settings, Aside(settings)

    def stop(self) -> None:
        """Ends what is being played: nobody waits for it any more."""
        self._aside.stop()

    def _answer(self, study: Study) -> bytes:
        contact = study.contact
        path, sha256 = series_file(contact.campaign.id, contact.episode, self._settings)
        load_arrays(path, sha256)  # else it is lost or damaged, and that is to be said
        try:
            spec = contact.campaign.run_spec(contact.run)
        except OutdatedError as error:
            raise CannotBePlayed(str(error)) from error
        question = Question(
            subject=study.subject,
            spec=spec,
            episode=contact.episode.record,
            series=path,
            format=study.format,
            twin=None if study.twin in (None, IDLE) else EgoConfig.model_validate({"profile": study.twin}),
        )
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile() as log:
            file = Path(folder) / "answer"
            try:
                status = self._ask(question, file, log)
                said = file.read_bytes() if file.exists() else b""
            except OSError as error:
                raise StorageError(f"it cannot be played ({error.strerror})") from error
            log.seek(0)
            tail = log.read()[-2000:].decode(errors="replace")
        if status == REFUSED:
            raise CannotBePlayed(without_folders(said.decode(errors="replace"), path.parent))
        if status != 0:
            logger.error("a study ended with status %d: %s", status, tail)
            raise CannotBePlayed("its process was lost; the log has the reason")
        return said

    def _ask(self, question: Question, file: Path, log: IO[bytes]) -> int:
        told = question.model_dump_json().encode() + b"\n"
        try:
            return self._aside.run("risk_sac.failures.study", [str(file)], log, told)
        except subprocess.TimeoutExpired as error:
            raise CannotBePlayed(f"it takes more than {WALL_S:g} s here") from error
