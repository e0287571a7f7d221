"""The one place where errors become HTTP: problem details (RFC 9457) that name the field."""

import logging
import math
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.routing import compile_path

from risk_sac.errors import ConfigError
from service.api.answers.fields import field_problems, parse, shown
from service.errors import ConflictError, CursorError, NotFoundError, QuotaError, StorageError
from service.schemas import FieldProblem, Problem, Reason

logger = logging.getLogger(__name__)

CLIENT_LEFT = 499  # in the middle of its request; nobody gets this answer, but the log and the metrics tell of it
_REASONS = {
    HTTPStatus.NOT_FOUND: Reason.UNKNOWN_ROUTE,
    HTTPStatus.METHOD_NOT_ALLOWED: Reason.METHOD_NOT_ALLOWED,
    HTTPStatus.NOT_ACCEPTABLE: Reason.NOT_ACCEPTABLE,
    HTTPStatus.UNSUPPORTED_MEDIA_TYPE: Reason.UNSUPPORTED_MEDIA_TYPE,
}


class ProblemError(Exception):
    """An answer that a route or a dependency decides on; the response says the same."""

    def __init__(
        self,
        status: HTTPStatus,
        reason: Reason,
        detail: str,
        *errors: FieldProblem,
        headers: dict[str, str] | None = None,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.reason = reason
        self.errors = errors
        self.headers = headers


def invalid_field(field: str, got: object, wanted: str) -> ProblemError:
    """The answer to a value that no schema could have told to be wrong."""
    detail = f"{field} is {shown(got)}; wanted {wanted}"
    item = FieldProblem(field=field, message=detail, got=shown(got), wanted=wanted)
    return ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, Reason.INVALID_FIELD, detail, item)


def add_problem_handlers(app: FastAPI) -> None:
    """Make every error response of the app a problem."""
    app.add_exception_handler(RequestValidationError, _invalid_request)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(ProblemError, _problem_error)
    app.add_exception_handler(ConfigError, _bad_config)
    app.add_exception_handler(CursorError, _bad_cursor)
    app.add_exception_handler(NotFoundError, _not_found)
    app.add_exception_handler(ConflictError, _conflict)
    app.add_exception_handler(QuotaError, _over_quota)
    app.add_exception_handler(StorageError, _storage_failed)
    app.add_exception_handler(ClientDisconnect, _left)
    app.add_exception_handler(Exception, _bug)


def problem_response(
    path: str,
    status: HTTPStatus,
    reason: Reason,
    detail: str,
    *errors: FieldProblem,
    headers: dict[str, str] | None = None,
) -> JSONResponse:
    """A problem as a response, which is an ASGI application: middleware has no more than a path to say.

    Args:
      path: of the request.
      status: of the response; the problem's type is stable for each.
      reason: stable for each cause.
      detail: what was got, what was wanted, and the remedy.
      errors: the fields to blame.
      headers: of the response.
    """
    body = Problem(
        type=f"urn:risk-sac:problem:{status.name.lower().replace('_', '-')}",
        title=status.phrase,
        status=status,
        reason=reason,
        detail=detail,
        instance=path,
        errors=list(errors),
    )
    return JSONResponse(body.model_dump(mode="json"), status, headers=headers, media_type="application/problem+json")


async def _invalid_request(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    found = error.errors()
    if any(item["type"] == "json_invalid" for item in found):
        detail = f"the body is no JSON: {found[0]['ctx']['error']}"
        return problem_response(request.url.path, HTTPStatus.BAD_REQUEST, Reason.MALFORMED_JSON, detail)
    errors = field_problems(found)
    return _invalid(request, "; ".join(f"{item.field}: {item.message}".removeprefix(": ") for item in errors), *errors)


async def _http_error(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    status = HTTPStatus(error.status_code)
    detail = str(error.detail)
    if status is HTTPStatus.NOT_FOUND:
        detail = f"nothing is at {request.url.path}; /docs lists all routes"
    headers = dict(error.headers or {})
    if status is HTTPStatus.METHOD_NOT_ALLOWED:
        headers["Allow"] = allowed = ", ".join(sorted(_methods(request, headers["Allow"])))
        detail = f"{request.url.path} does not answer {request.method}; it answers {allowed}"
    return problem_response(request.url.path, status, _REASONS[status], detail, headers=headers)


async def _problem_error(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, ProblemError)
    path, headers = request.url.path, error.headers
    return problem_response(path, error.status, error.reason, str(error), *error.errors, headers=headers)


async def _bad_config(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, ConfigError)
    _, got, wanted = parse(str(error))
    item = FieldProblem(field=error.field, message=str(error), got=got, wanted=wanted)
    return _invalid(request, str(error), item)


async def _bad_cursor(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, CursorError)
    item = FieldProblem(
        field="cursor", message=str(error), got=shown(error.got), wanted="the `next` of an earlier page, unchanged"
    )
    return _invalid(request, str(error), item)


async def _not_found(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, NotFoundError)
    item = FieldProblem(field=error.field, message=str(error), got=shown(error.got), wanted="an existing id")
    return problem_response(request.url.path, HTTPStatus.NOT_FOUND, Reason.UNKNOWN_ID, str(error), item)


async def _conflict(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, ConflictError)
    return problem_response(request.url.path, HTTPStatus.CONFLICT, Reason(error.reason), str(error))


async def _over_quota(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, QuotaError)
    status, headers = HTTPStatus.TOO_MANY_REQUESTS, {"Retry-After": str(math.ceil(error.retry_after_s))}
    return problem_response(request.url.path, status, Reason.QUOTA_EXCEEDED, str(error), headers=headers)


async def _storage_failed(request: Request, error: Exception) -> JSONResponse:
    logger.error("%s %s: %s", request.method, request.url.path, error)
    status = HTTPStatus.SERVICE_UNAVAILABLE
    return problem_response(request.url.path, status, Reason.STORAGE_UNAVAILABLE, str(error))


async def _left(request: Request, error: Exception) -> Response:
    return Response(status_code=CLIENT_LEFT)


async def _bug(request: Request, error: Exception) -> JSONResponse:
    detail = f"the service has a bug ({type(error).__name__}); its log has the traceback"
    return problem_response(request.url.path, HTTPStatus.INTERNAL_SERVER_ERROR, Reason.INTERNAL_ERROR, detail)


def _invalid(request: Request, detail: str, *errors: FieldProblem) -> JSONResponse:
    status = HTTPStatus.UNPROCESSABLE_ENTITY
    return problem_response(request.url.path, status, Reason.INVALID_FIELD, detail, *errors)


def _methods(request: Request, of_first: str) -> set[str]:
    """Methods that some route answers at this path; Starlette names only those of the first."""
    paths: dict[str, dict[str, Any]] = request.app.openapi()["paths"]
    matching = (methods for path, methods in paths.items() if compile_path(path)[0].match(request.url.path))
    found = {method.upper() for methods in matching for method in methods} | set(of_first.split(", "))
    return found | {"HEAD"} if "GET" in found else found
