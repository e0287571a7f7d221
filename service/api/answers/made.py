"""What routes say of what is made when asked for: too many wait for theirs, or its packages are not here."""

from http import HTTPStatus
from typing import Literal

from risk_sac.failures.export.formats import FORMATS, FormatName
from service.api.answers.problems import ProblemError
from service.api.answers.responses import STORAGE, Responses, header, problem
from service.schemas.problems import Reason
from service.views.on_demand import TooManyWaiting

RETRY_AFTER_S = 2  # in which some of those who wait get theirs
LACKING = problem(501, "The service lacks a package that makes this format")
CROWDED: Responses = {
    503: STORAGE[503]
    | {
        "description": "The database cannot be read, or too many wait for theirs",
        "headers": {"Retry-After": header("Seconds until asking again pays.", "integer", required=False)},
    }
}


def check_installed(format: FormatName, of: Literal["failure", "episodes"]) -> None:
    """Refuses a format whose packages the service lacks: that is no mistake of who asks.

    Raises:
      ProblemError: naming them, and what brings them.
    """
    row = FORMATS[format]
    if row.of == of and row.missing:
        lacks = f"{format} needs {', '.join(row.missing)}, which is not installed here: {row.remedy}"
        raise ProblemError(HTTPStatus.NOT_IMPLEMENTED, Reason.NOT_INSTALLED, lacks)


def crowded(error: TooManyWaiting) -> ProblemError:
    """The answer to one too many."""
    wait = {"Retry-After": str(RETRY_AFTER_S)}
    return ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.PICTURES_BUSY, str(error), headers=wait)
