"""Studies of a failure, which need the simulator, in a helper process, see `risk_sac.failures.study`."""

import logging
from dataclasses import dataclass

from risk_sac.config import EgoConfig
from risk_sac.execution.helper import ANSWER, QUESTION
from risk_sac.execution.postmortem import without_folders
from risk_sac.failures.export.formats import FormatName
from risk_sac.failures.question import IDLE, REFUSED, Question, Subject, Twin
from service.errors import NotPlayable, OutdatedError
from service.settings import ServiceSettings
from service.views.bodies import series_file
from service.views.on_demand import WALL_S, Helper, OnDemandCache
from service.views.pictures import ContactOfARun
from service.views.series import load_arrays

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Study:
    """A question about a contact."""

    contact: ContactOfARun
    subject: Subject
    twin: Twin | None = None
    """Of a twin: which."""
    format: FormatName | None = None
    """Of an export: which."""


class Studies(OnDemandCache[Study]):
    """Answers, one at a time; SeriesLost where the time series is lost, NotPlayable where nothing can be said."""

    def __init__(self, settings: ServiceSettings, helper: Helper) -> None:
        super().__init__(self._answer, "failures")
        self._settings, self._helper = settings, helper

    def _answer(self, study: Study) -> bytes:
        contact = study.contact
        path, sha256 = series_file(contact.campaign.id, contact.stored, self._settings)
        load_arrays(path, sha256)  # raises where it is lost or damaged
        try:
            spec = contact.campaign.run_spec(contact.run)
        except OutdatedError as error:
            raise NotPlayable(str(error)) from error
        question = Question(
            subject=study.subject,
            spec=spec,
            episode=contact.episode,
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
