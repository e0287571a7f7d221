"""The answer to whoever comes while as much is at work as may be."""

from http import HTTPStatus

from service.api.answers.problems import ProblemError
from service.networks.errors import BusyError
from service.schemas.problems import Reason


def busy(error: BusyError) -> ProblemError:
    """503, and when to come again."""
    headers = {"Retry-After": str(error.retry_after_s)}
    return ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.UPLOADS_BUSY, str(error), headers=headers)
