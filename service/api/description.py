"""The API's description, as OpenAPI."""

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import TypeAdapter

from risk_sac.records import StateChange
from service.api.guards.description import describe_guards
from service.api.posted import input_schemas
from service.api.posted_campaign import campaign_schemas
from service.schemas.posted import PostedRegression, PostedTriage

DESCRIPTION = """Finds scenarios in which an automated driving system fails.

Post a campaign, follow it, read what it found. All errors are problem details (RFC 9457) that name the field, with a
`reason` that does not change when messages do. Whatever answers GET answers HEAD, too. Text of 2 kB and more travels
packed where `Accept-Encoding` names gzip."""


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
    describe_guards(document)
    return document


def _event_schemas() -> dict[str, Any]:
    """What no response declares, because it travels within a stream."""
    schema = TypeAdapter(StateChange).json_schema(ref_template="#/components/schemas/{model}")
    schema.pop("$defs")
    return {"StateChange": schema}
