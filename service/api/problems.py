"""Maps errors to HTTP: problem details (RFC 9457) that name the field."""

import logging
import math
from collections.abc import Mapping
from enum import StrEnum
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.routing import compile_path
from starlette.types import Scope

from risk_sac.config.base import LONGEST_VALUE, causes, field_error, shown
from risk_sac.errors import ConfigError, DamagedError
from risk_sac.records import FieldProblem, Record
from service.errors import (
    BusyError,
    ConflictError,
    NotFoundError,
    NotPlayable,
    QuotaError,
    SeriesLost,
    StorageError,
    UploadError,
)

logger = logging.getLogger(__name__)


class Reason(StrEnum):
    """Stable name of an error; `detail` explains it."""

    MALFORMED_HTTP = "malformed_http"
    MALFORMED_JSON = "malformed_json"
    UNKNOWN_HOST = "unknown_host"
    UNAUTHORIZED = "unauthorized"
    FORBIDDEN = "forbidden"
    FOREIGN_ORIGIN = "foreign_origin"
    UNKNOWN_ROUTE = "unknown_route"
    UNKNOWN_ID = "unknown_id"
    METHOD_NOT_ALLOWED = "method_not_allowed"
    IDEMPOTENCY_KEY_REUSED = "idempotency_key_reused"
    NOT_ENDED = "not_ended"
    TOO_LARGE = "too_large"
    UPLOAD_TOO_SLOW = "upload_too_slow"
    UPLOAD_REFUSED = "upload_refused"
    UPLOADS_BUSY = "uploads_busy"
    PICTURES_BUSY = "pictures_busy"
    SERIES_LOST = "series_lost"
    NOT_PLAYABLE = "not_playable"
    NOT_INSTALLED = "not_installed"
    TOO_MANY_NETWORKS = "too_many_networks"
    TOO_MANY_SCENARIOS = "too_many_scenarios"
    SCENARIO_IN_USE = "scenario_in_use"
    UNSUPPORTED_MEDIA_TYPE = "unsupported_media_type"
    INVALID_FIELD = "invalid_field"
    QUOTA_EXCEEDED = "quota_exceeded"
    RATE_LIMITED = "rate_limited"
    INTERNAL_ERROR = "internal_error"
    KEYS_UNAVAILABLE = "keys_unavailable"
    CONNECTIONS_BUSY = "connections_busy"
    STORAGE_UNAVAILABLE = "storage_unavailable"
    MANAGER_STOPPED = "manager_stopped"


class ProblemDetails(Record):
    """Problem details (RFC 9457)."""

    type: str
    title: str
    status: int
    reason: Reason
    detail: str
    instance: str
    errors: list[FieldProblem]
    """Empty when no field is to blame."""


CLIENT_LEFT = 499  # during its request; no client gets this answer, but log and metrics have it
_REASONS = {
    HTTPStatus.NOT_FOUND: Reason.UNKNOWN_ROUTE,
    HTTPStatus.METHOD_NOT_ALLOWED: Reason.METHOD_NOT_ALLOWED,
    HTTPStatus.UNSUPPORTED_MEDIA_TYPE: Reason.UNSUPPORTED_MEDIA_TYPE,
}


RETRY_S = 5  # before a client asks again, where an error says nothing else
RETRIED = frozenset({HTTPStatus.TOO_MANY_REQUESTS, HTTPStatus.SERVICE_UNAVAILABLE})


class ProblemError(Exception):
    """Error answer; `detail` names what was got and expected, and the remedy.

    Each 429 and 503 has a `Retry-After`: `retry_s`.
    """

    def __init__(
        self,
        status: HTTPStatus,
        reason: Reason,
        detail: str,
        *errors: FieldProblem,
        headers: Mapping[str, str] = {},
        retry_s: float = RETRY_S,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.reason = reason
        self.errors = errors
        self.headers = {**headers, "Retry-After": str(math.ceil(retry_s))} if status in RETRIED else dict(headers)


class NotModified(Exception):
    """The client has the representation; the answer is a 304 with `headers`."""

    def __init__(self, headers: Mapping[str, str]) -> None:
        super().__init__(headers)
        self.headers = headers


def invalid_field(field: str, got: object, wanted: str) -> ProblemError:
    """Returns the answer to a wrong value that no schema detects."""
    detail = f"{field} is {shown(got)}; wanted {wanted}"
    return invalid(detail, FieldProblem(field=field, message=detail, got=shown(got), wanted=wanted))


# Errors that say what is wrong; any other is a bug of the service, of which the server logs the traceback.
_OF_REQUESTS = (RequestValidationError, HTTPException, ProblemError, ConfigError)
_OF_THE_SERVICE = (
    NotFoundError,
    ConflictError,
    QuotaError,
    BusyError,
    UploadError,
    StorageError,
    NotPlayable,
    DamagedError,
)


def add_problem_handlers(app: FastAPI) -> None:
    """Makes every error response of the app a problem."""
    for kind in (*_OF_REQUESTS, *_OF_THE_SERVICE, Exception):
        app.add_exception_handler(kind, _answer)
    app.add_exception_handler(ClientDisconnect, _left)
    app.add_exception_handler(NotModified, _not_modified)


def problem_response(path: str, problem: ProblemError) -> JSONResponse:
    """Returns a problem as a response, given the path alone."""
    body = ProblemDetails(
        type=f"urn:risk-sac:problem:{problem.status.name.lower().replace('_', '-')}",
        title=problem.status.phrase,
        status=problem.status,
        reason=problem.reason,
        detail=str(problem),
        instance=path,
        errors=list(problem.errors),
    )
    content, headers = body.model_dump(mode="json"), problem.headers
    return JSONResponse(content, problem.status, headers=headers, media_type="application/problem+json")


def route_path(scope: Scope) -> str:
    """Returns the path of a request without the proxy's prefix."""
    return str(scope["path"]).removeprefix(scope.get("root_path", ""))


async def _answer(request: Request, error: Exception) -> JSONResponse:
    problem = error if isinstance(error, ProblemError) else _problem(request, error)
    return problem_response(request.url.path, problem)


def _problem(request: Request, error: Exception) -> ProblemError:
    """Returns the problem of an error."""
    detail = str(error)
    match error:
        case RequestValidationError():
            return _invalid_request(error)
        case HTTPException():
            return _http_error(request, error)
        case ConfigError():
            faults = (error, *error.others)
            return invalid("; ".join(map(str, faults)), *(_field_problem(fault, str(fault)) for fault in faults))
        case NotFoundError():
            item = FieldProblem(field=error.field, message=detail, got=shown(error.got), wanted="an existing id")
            return ProblemError(HTTPStatus.NOT_FOUND, Reason.UNKNOWN_ID, detail, item)
        case ConflictError():
            return ProblemError(HTTPStatus.CONFLICT, Reason(error.reason), detail)
        case QuotaError():
            status = HTTPStatus.TOO_MANY_REQUESTS
            return ProblemError(status, Reason.QUOTA_EXCEEDED, detail, retry_s=error.retry_after_s)
        case BusyError():
            status = HTTPStatus.SERVICE_UNAVAILABLE
            return ProblemError(status, Reason(error.reason), detail, retry_s=error.retry_after_s)
        case SeriesLost():
            detail = f"{request.path_params['failure_id']!r} cannot be shown: {detail}"
            return ProblemError(HTTPStatus.NOT_FOUND, Reason.SERIES_LOST, detail)
        case NotPlayable():
            detail = f"{request.path_params['failure_id']!r}: {detail}"
            return ProblemError(HTTPStatus.CONFLICT, Reason.NOT_PLAYABLE, detail)
        case UploadError():
            return ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, Reason.UPLOAD_REFUSED, detail)
        case StorageError() | DamagedError():
            logger.error("%s %s: %s", request.method, request.url.path, detail)
            return ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.STORAGE_UNAVAILABLE, detail)
    detail = f"the service has a bug ({type(error).__name__}); its log has the traceback"
    return ProblemError(HTTPStatus.INTERNAL_SERVER_ERROR, Reason.INTERNAL_ERROR, detail)


def _invalid_request(error: RequestValidationError) -> ProblemError:
    found = error.errors()
    errors = [_of_validation(item, error.body) for item in causes(found)]
    return invalid("; ".join(f"{item.field}: {item.message}".removeprefix(": ") for item in errors), *errors)


def _of_validation(item: Mapping[str, Any], model: type[BaseModel] | None) -> FieldProblem:
    """Describes one validation error; `model` is the body's, None without a body."""
    part, *location = item["loc"]
    inside = location if part in ("body", "query", "path", "header") else item["loc"]
    message = str(item["msg"]).removeprefix("Value error, ")
    cause = item.get("ctx", {}).get("error")
    if isinstance(cause, ConfigError):  # its text begins with its field, which the answer has beside it
        message = message.removeprefix(f"{cause.field}: ")
    return _field_problem(field_error({**item, "loc": tuple(inside)}, model), message)


def _field_problem(error: ConfigError, message: str) -> FieldProblem:
    field = error.field.encode("ascii", "backslashreplace").decode()[:LONGEST_VALUE]
    wanted = error.expected or error.remedy or message
    return FieldProblem(field=field, message=message, got=error.got, wanted=wanted)


def _http_error(request: Request, error: HTTPException) -> ProblemError:
    status = HTTPStatus(error.status_code)
    detail = str(error.detail)
    if status is HTTPStatus.NOT_FOUND:
        detail = f"nothing is at {request.url.path}; /docs lists all routes"
    headers = dict(error.headers or {})
    if status is HTTPStatus.METHOD_NOT_ALLOWED:
        headers["Allow"] = allowed = ", ".join(sorted(_methods(request, headers.get("Allow", "GET"))))
        detail = f"{request.url.path} does not answer {request.method}; it answers {allowed}"
    return ProblemError(status, _REASONS[status], detail, headers=headers)


def invalid(detail: str, *errors: FieldProblem) -> ProblemError:
    """The answer to a request that holds something wrong."""
    return ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, Reason.INVALID_FIELD, detail, *errors)


async def _not_modified(request: Request, error: Exception) -> Response:
    assert isinstance(error, NotModified)
    return Response(status_code=304, headers=error.headers)


async def _left(request: Request, error: Exception) -> Response:
    return Response(status_code=CLIENT_LEFT)


def _methods(request: Request, of_first: str) -> set[str]:
    """Returns the methods of all routes at this path, not the first's.

    A path without parameters takes precedence, as in OpenAPI: `check` is no campaign id.
    """
    paths: dict[str, dict[str, Any]] = request.app.openapi()["paths"]
    asked = route_path(request.scope)
    matching = [paths[asked]] if asked in paths else [paths[p] for p in paths if compile_path(p)[0].match(asked)]
    found = {method.upper() for methods in matching for method in methods} or set(of_first.split(", "))
    return found | {"HEAD"} if "GET" in found else found
