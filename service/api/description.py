"""The API's description, as OpenAPI."""

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import TypeAdapter

from risk_sac.records import StateChange
from service.api.guards.gate import HEALTH, PUBLIC
from service.api.posted import input_schemas
from service.api.posted_campaign import campaign_schemas
from service.schemas.posted import PostedRegression, PostedTriage

DESCRIPTION = """Finds scenarios in which an automated driving system fails.

Post a campaign, follow it, read what it found. All errors are problem details (RFC 9457) that name the field, with a
`reason` that does not change when messages do. Whatever answers GET answers HEAD, too. Text of 2 kB and more travels
packed where `Accept-Encoding` names gzip."""

_SECURITY = {
    "ApiKey": {
        "type": "http",
        "scheme": "bearer",
        "description": "Made by `risk-sac keys create`. On a loopback address none is needed until one was made.",
    }
}
_WAIT = {"Retry-After": {"description": "Seconds until asking again pays.", "schema": {"type": "integer"}}}
_SCHEME = {"WWW-Authenticate": {"description": "`Bearer`", "schema": {"type": "string"}}}
_Answers = dict[str, tuple[str, dict[str, Any]]]
_FULL = "too many connections are open"
_ALL: _Answers = {
    "408": ("The body comes too slowly", {}),
    "413": ("The body is too large", {}),
    "421": ("The Host header names no address of this service", {}),
    "503": (_FULL.capitalize(), _WAIT),
}
_COUNTED: _Answers = {"429": ("Too many requests, or too much for the project's quota", _WAIT)}
_GUARDED: _Answers = {
    "401": ("The API key is missing, wrong or revoked", _SCHEME),
    "403": ("The API key does not reach so far, or the request comes from a foreign page", {}),
    "503": (f"The API keys are lost or damaged, as `detail` says, or {_FULL}", _WAIT),
}


def openapi(app: FastAPI) -> dict[str, Any]:
    """The app's OpenAPI document, with every error response declared as a problem."""
    if app.openapi_schema is None:
        app.openapi_schema = _document(app)
    return app.openapi_schema


def _document(app: FastAPI) -> dict[str, Any]:
    document = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes)
    document["components"]["schemas"] |= campaign_schemas()
    for posted in (PostedRegression, PostedTriage):
        document["components"]["schemas"] |= input_schemas(posted)
    document["components"]["schemas"] |= _event_schemas()
    for operations in document["paths"].values():
        for operation in operations.values():
            for status, response in operation["responses"].items():
                if int(status) >= 400:
                    response["content"] = {"application/problem+json": response["content"]["application/json"]}
    _describe_guards(document)
    return document


def _event_schemas() -> dict[str, Any]:
    """What no response declares, because it travels within a stream."""
    schema = TypeAdapter(StateChange).json_schema(ref_template="#/components/schemas/{model}")
    schema.pop("$defs")
    return {"StateChange": schema}


def _describe_guards(document: dict[str, Any]) -> None:
    """Adds the key, and to each operation what the guards may answer; what a route declares itself goes first."""
    document["components"]["securitySchemes"] = _SECURITY
    for path, operations in document["paths"].items():
        answers = _ALL | ({} if path in HEALTH else _COUNTED) | ({} if path in PUBLIC else _GUARDED)
        for operation in operations.values():
            # Either of them: whether a key is needed depends on the address and the keys of the server.
            operation["security"] = [] if path in PUBLIC else [{"ApiKey": []}, {}]
            for status, (description, headers) in answers.items():
                operation["responses"].setdefault(status, _problem(description, headers))
            operation["responses"] = dict(sorted(operation["responses"].items()))


def _problem(description: str, headers: dict[str, Any]) -> dict[str, Any]:
    content = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {"description": description, **({"headers": headers} if headers else {}), "content": content}
