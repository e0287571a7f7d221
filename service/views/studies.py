"""What takes the simulator to say of a failure: asked of a process of its own, see `risk_sac.failures.study`."""

import logging
import threading
from dataclasses import dataclass

from risk_sac.config import EgoConfig
from risk_sac.execution.helper import ANSWER, QUESTION, run_helper
from risk_sac.execution.postmortem import without_folders
from risk_sac.failures.export.formats import FormatName
from risk_sac.failures.question import IDLE, REFUSED, Question, Subject, Twin
from service.errors import OutdatedError, ServiceError, StorageError
from service.settings import ServiceSettings
from service.views.bodies import series_file
from service.views.on_demand import OnDemandCache
from service.views.pictures import ContactOfARun
from service.views.series import load_arrays

logger = logging.getLogger(__name__)

WALL_S = 300.0  # a minimisation takes ten on a machine with nothing else to do


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


class Studies(OnDemandCache[Study]):
    """Answers, one at a time; StorageError where the time series is lost, CannotBePlayed where nothing can be said."""

    def __init__(self, settings: ServiceSettings) -> None:
        super().__init__(self._answer, "failures")
        self._settings, self._stopping = settings, threading.Event()

    def stop(self) -> None:
        """Ends the study at work."""
        self._stopping.set()

    def _answer(self, study: Study) -> bytes:
        contact = study.contact
        path, sha256 = series_file(contact.campaign.id, contact.stored, self._settings)
        load_arrays(path, sha256)  # else it is lost or damaged, and that is to be said
        try:
            spec = contact.campaign.run_spec(contact.run)
        except OutdatedError as error:
            raise CannotBePlayed(str(error)) from error
        question = Question(
            subject=study.subject,
            spec=spec,
            episode=contact.episode,
            series=path,
            format=study.format,
            twin=None if study.twin in (None, IDLE) else EgoConfig.model_validate({"profile": study.twin}),
        )
        try:
            result = run_helper(
                "risk_sac.failures.study",
                [QUESTION, ANSWER],
                question=question.model_dump_json().encode(),
                wall_s=WALL_S,
                niceness=self._settings.worker_niceness,
                stopping=self._stopping.is_set,
            )
        except OSError as error:
            raise StorageError(f"it cannot be played ({error.strerror})") from error
        if result.timed_out:
            raise CannotBePlayed(f"it takes more than {WALL_S:g} s here")
        if result.status == REFUSED:
            raise CannotBePlayed(without_folders(result.answer.decode(errors="replace"), path.parent))
        if result.status != 0:
            logger.error("a study ended with status %d: %s", result.status, result.log)
            raise CannotBePlayed("its process was lost; the log has the reason")
        return result.answer
