"""The one place where errors become HTTP: problem details (RFC 9457) that name the field."""

import json
import logging
import re
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.routing import compile_path

from risk_sac.config import CampaignSpec
from risk_sac.errors import ConfigError
from service.errors import CursorError, NotFoundError, StorageError
from service.schemas import FieldProblem, Problem

logger = logging.getLogger(__name__)

LONGEST_VALUE = 200
# How this project words an error: "reaction_time_s is 0.55; wanted a multiple of 0.1", or where the
# field goes without saying: "column 3: got 'x', wanted a signal".
_HOUSE_STYLES = (
    re.compile(r"(?P<field>[\w.]+) (?:is|are named) (?P<got>.+?); (?:wanted )?(?P<wanted>.+)", re.DOTALL),
    re.compile(r"(?P<field>).*?\bgot (?P<got>.+?)[,;] wanted (?P<wanted>.+)", re.DOTALL),
)
_LIMITS = {
    "greater_than": "> {gt}",
    "greater_than_equal": ">= {ge}",
    "less_than": "< {lt}",
    "less_than_equal": "<= {le}",
    "literal_error": "{expected}",
    "enum": "{expected}",
    "string_pattern_mismatch": "a string matching {pattern}",
    "string_too_short": "at least {min_length} characters",
    "string_too_long": "at most {max_length} characters",
    "too_short": "at least {min_length} entries",
    "too_long": "at most {max_length} entries",
    "missing": "a value",
    "finite_number": "a finite number",
    "float_type": "a number",
    "int_type": "an integer",
    "model_type": "a JSON object",
    "tuple_type": "a JSON array",
}

Location = tuple[int | str, ...]


def add_problem_handlers(app: FastAPI) -> None:
    """Make every error response of the app a problem."""
    app.add_exception_handler(RequestValidationError, _invalid_request)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(ConfigError, _bad_config)
    app.add_exception_handler(CursorError, _bad_cursor)
    app.add_exception_handler(NotFoundError, _not_found)
    app.add_exception_handler(StorageError, _storage_failed)
    app.add_exception_handler(Exception, _bug)


def problem(
    request: Request, status: HTTPStatus, detail: str, *errors: FieldProblem, headers: dict[str, str] | None = None
) -> JSONResponse:
    """A problem response; its type is stable for each status."""
    body = Problem(
        type=f"urn:risk-sac:problem:{status.name.lower().replace('_', '-')}",
        title=status.phrase,
        status=status,
        detail=detail,
        instance=request.url.path,
        errors=list(errors),
    )
    return JSONResponse(body.model_dump(), status, headers=headers, media_type="application/problem+json")


async def _invalid_request(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    found = error.errors()
    if any(item["type"] == "json_invalid" for item in found):
        return problem(request, HTTPStatus.BAD_REQUEST, f"the body is no JSON: {found[0]['ctx']['error']}")
    locations = [item["loc"] for item in found]
    causes = [item for item in found if not _follows(item["loc"], locations)]
    errors = [_field_problem(item) for item in causes]
    detail = "; ".join(f"{item.field}: {item.message}" if item.field else item.message for item in errors)
    return problem(request, HTTPStatus.UNPROCESSABLE_ENTITY, detail, *errors)


async def _http_error(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    status = HTTPStatus(error.status_code)
    detail = str(error.detail)
    if status is HTTPStatus.NOT_FOUND:
        detail = f"nothing is at {request.url.path}; /docs lists all routes"
    headers = dict(error.headers or {})
    if status is HTTPStatus.METHOD_NOT_ALLOWED:
        headers["Allow"] = allowed = ", ".join(sorted(_methods(request))) or headers["Allow"]
        detail = f"{request.url.path} does not answer {request.method}; it answers {allowed}"
    return problem(request, status, detail, headers=headers)


async def _bad_config(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, ConfigError)
    _, got, wanted = _parse(str(error))
    item = FieldProblem(field=error.field, message=str(error), got=got, wanted=wanted)
    return problem(request, HTTPStatus.UNPROCESSABLE_ENTITY, str(error), item)


async def _bad_cursor(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, CursorError)
    item = FieldProblem(
        field="cursor", message=str(error), got=_shown(error.got), wanted="the `next` of an earlier page, unchanged"
    )
    return problem(request, HTTPStatus.UNPROCESSABLE_ENTITY, str(error), item)


async def _not_found(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, NotFoundError)
    item = FieldProblem(field=error.field, message=str(error), got=_shown(error.got), wanted="an existing id")
    return problem(request, HTTPStatus.NOT_FOUND, str(error), item)


async def _storage_failed(request: Request, error: Exception) -> JSONResponse:
    logger.error("%s %s: %s", request.method, request.url.path, error)
    return problem(request, HTTPStatus.SERVICE_UNAVAILABLE, str(error))


async def _bug(request: Request, error: Exception) -> JSONResponse:
    detail = f"the service has a bug ({type(error).__name__}); its log has the traceback"
    return problem(request, HTTPStatus.INTERNAL_SERVER_ERROR, detail)


def _methods(request: Request) -> set[str]:
    """Methods that some route answers at this path; Starlette names only those of the first."""
    paths: dict[str, dict[str, Any]] = request.app.openapi()["paths"]
    matching = (methods for path, methods in paths.items() if compile_path(path)[0].match(request.url.path))
    return {method.upper() for methods in matching for method in methods}


def _follows(location: Location, others: Sequence[Location]) -> bool:
    """Whether an error only repeats one inside it: a list "too short" once its bad entries are dropped."""
    return any(len(other) > len(location) and other[: len(location)] == location for other in others)


def _field_problem(item: dict[str, Any]) -> FieldProblem:
    location: Location = item["loc"]
    path = _dotted(location)
    message = str(item["msg"]).removeprefix("Value error, ")
    got = "nothing" if item["type"] == "missing" else _shown(item.get("input"))
    wanted = _wanted(item, location)
    if item["type"] == "value_error":
        field, stated, wanted = _parse(message)
        path = f"{path}.{field}".strip(".")
        got = stated or got
    return FieldProblem(field=_ascii(path), message=message, got=got, wanted=wanted)


def _dotted(location: Location) -> str:
    """`requirements[0].name`, without the part that says where in the request it was."""
    parts = location[1:] if location[0] in ("body", "query", "path") else location
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts).removeprefix(".")


def _wanted(item: dict[str, Any], location: Location) -> str:
    if item["type"] == "extra_forbidden":
        return f"one of {', '.join(_known_fields(location[1:-1]))}"
    template = _LIMITS.get(item["type"])
    if template:
        return template.format(**item.get("ctx", {}))
    return str(item["msg"]).removeprefix("Input should be ").partition(",")[0]


def _parse(message: str) -> tuple[str, str, str]:
    """Field, got and wanted of a message in house style; the whole message is wanted where it is not."""
    for style in _HOUSE_STYLES:
        if match := style.fullmatch(message):
            return match["field"], match["got"], match["wanted"]
    return "", "", message


def _known_fields(location: Location) -> list[str]:
    """Names of the fields that a campaign has at a location of its JSON schema."""
    schema = CampaignSpec.model_json_schema()
    node = schema
    for part in location:
        node = _resolve(schema, node)
        node = node["properties"][part] if isinstance(part, str) else node["items"]
    return sorted(_resolve(schema, node)["properties"])


def _resolve(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    node = next((option for option in node.get("anyOf", []) if option.get("type") != "null"), node)
    reference: str | None = node.get("$ref")
    return node if reference is None else schema["$defs"][reference.rpartition("/")[2]]


def _shown(value: object) -> str:
    text = json.dumps(value, default=str)  # ASCII, so that lone surrogates survive
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}…"


def _ascii(text: str) -> str:
    return text.encode("ascii", "backslashreplace").decode()
