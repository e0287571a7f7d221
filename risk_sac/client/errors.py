"""Errors of the client."""

import math
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime

import httpx
from pydantic import BaseModel, ValidationError

from risk_sac.errors import RiskSacError
from risk_sac.records import FieldProblem


class ClientError(RiskSacError):
    """Root of the client's errors."""

    passing: bool = False  # a retry may help and does no harm
    retry_after_s: float | None = None  # the wait that the service asked for


class Unreachable(ClientError):
    """No answer, or an incomplete one."""

    def __init__(self, url: str, error: httpx.RequestError, *, passing: bool) -> None:
        super().__init__(f"{url} does not answer: {str(error) or type(error).__name__}")
        self.passing = passing


class StreamLost(Unreachable):
    """The stream of events broke after it had begun; it continues after the last event that arrived."""


class _Problem(BaseModel):
    detail: str
    reason: str = ""
    errors: tuple[FieldProblem, ...] = ()


class Refused(ClientError):
    """The service answered with a problem; of a proxy's own page only the status is known."""

    def __init__(self, response: httpx.Response, *, passing: bool) -> None:
        try:
            problem = _Problem.model_validate_json(response.content, extra="allow")
        except ValidationError:
            problem = _Problem(detail=response.reason_phrase)
        super().__init__(f"{response.url} answered {response.status_code}: {problem.detail}")
        self.status = response.status_code
        self.reason = problem.reason  # one word that is stable for each cause, such as `unknown_id`; empty from a proxy
        self.detail = problem.detail  # what was got and wanted, for people
        self.fields = problem.errors  # to blame; may be none
        self.passing = passing
        self.retry_after_s = retry_after_s(response)


class UnexpectedAnswer(ClientError):
    """The answer is not what this version of the service says."""

    def __init__(self, response: httpx.Response, wanted: str) -> None:
        type_ = response.headers.get("content-type", "no content-type")
        super().__init__(
            f"{response.url} answered {response.status_code} with {type_}; wanted {wanted}: "
            "is it a RISK-SAC service, and not much older or newer than this client?"
        )


class Overdue(ClientError):
    """The campaign did not end within the time that the caller gave it; it goes on."""


def retry_after_s(response: httpx.Response) -> float | None:
    """Returns the seconds of a Retry-After header, a number or a date; None without a valid one."""
    value = response.headers.get("retry-after", "")
    try:
        seconds = float(value)
    except ValueError:
        try:
            at = parsedate_to_datetime(value)
        except ValueError:
            return None
        seconds = (at.replace(tzinfo=at.tzinfo or UTC) - datetime.now(UTC)).total_seconds()
    return max(0.0, seconds) if math.isfinite(seconds) else None
