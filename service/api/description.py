"""The API's description, as OpenAPI."""

import itertools
import json
import re
from collections import Counter
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import TypeAdapter

from risk_sac.config import FamilyName, MethodName
from risk_sac.config.methods import RunMethod
from risk_sac.records import StateChange
from service.api.answers.responses import WAIT, header
from service.api.examples import describe_calls
from service.api.guards.gate import HEALTH, PUBLIC
from service.api.posted import campaign_schemas, input_schemas
from service.api.routes.episodes import PostedTriage
from service.api.routes.regressions import PostedRegression

DESCRIPTION = """Finds scenarios in which an automated driving system fails.

Post a campaign, follow it, read what it found. All errors are problem details (RFC 9457) that name the field, with a
`reason` that does not change when messages do. HEAD works wherever GET does. Text of 2 kB and more is
compressed where `Accept-Encoding` names gzip."""

_SECURITY = {
    "ApiKey": {
        "type": "http",
        "scheme": "bearer",
        "description": "Made by `risk-sac keys create`. On a loopback address none is needed until one was made.",
    }
}
_SCHEME = {"WWW-Authenticate": header("`Bearer`", required=False)}
_Answers = dict[str, tuple[str, dict[str, Any]]]
_FULL = "too many connections are open"
_BODY: _Answers = {"408": ("The body comes too slowly", {}), "413": ("The body is too large", {})}
_ALL: _Answers = {
    "421": ("The Host header names no address of this service", {}),
    "503": (_FULL.capitalize(), WAIT),
}
_COUNTED: _Answers = {"429": ("Too many requests, or too much for the project's quota", WAIT)}
_GUARDED: _Answers = {
    "401": ("The API key is missing, wrong or revoked", _SCHEME),
    "403": ("The API key does not reach so far, or the request comes from a foreign page", {}),
    "503": (f"The API keys are lost or damaged, as `detail` says, or {_FULL}", WAIT),
}
_CHOICES: dict[str, dict[str, Any]] = {
    "FamilyName": TypeAdapter(FamilyName).json_schema(),
    "MethodName": TypeAdapter(MethodName).json_schema(),
    "RunMethod": TypeAdapter(RunMethod).json_schema(),
}


def openapi(app: FastAPI) -> dict[str, Any]:
    """The app's OpenAPI document, with every error response declared as a problem."""
    if app.openapi_schema is None:
        app.openapi_schema = _document(app)
    return app.openapi_schema


def _document(app: FastAPI) -> dict[str, Any]:
    document = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes)
    schemas = document["components"]["schemas"]
    schemas |= campaign_schemas() | input_schemas(PostedRegression) | input_schemas(PostedTriage) | _event_schemas()
    for operations in document["paths"].values():
        for operation in operations.values():
            for status, response in operation["responses"].items():
                if response["description"] == "Successful Response":
                    response["description"] = HTTPStatus(int(status)).phrase
                if int(status) >= 400:
                    response["content"] = {"application/problem+json": response["content"]["application/json"]}
    _describe_guards(document)
    document["components"]["schemas"] = _simplified(schemas) | _CHOICES
    document["paths"] = _simplified(document["paths"])
    describe_calls(document["paths"])
    _share(document)
    return document


def _event_schemas() -> dict[str, Any]:
    """Returns schemas of events, which no response declares."""
    schema = TypeAdapter(StateChange).json_schema(ref_template="#/components/schemas/{model}")
    schema.pop("$defs")
    return {"StateChange": schema}


def _describe_guards(document: dict[str, Any]) -> None:
    """Adds the key scheme, and the guards' answers to each operation that declares none."""
    document["components"]["securitySchemes"] = _SECURITY
    # Either of them: whether a key is needed depends on the address and the keys of the server.
    document["security"] = [{"ApiKey": []}, {}]
    for path, operations in document["paths"].items():
        answers = _ALL | ({} if path in HEALTH else _COUNTED) | ({} if path in PUBLIC else _GUARDED)
        for operation in operations.values():
            if path in PUBLIC:
                operation["security"] = []
            body = _BODY if "requestBody" in operation else {}
            for status, (description, headers) in (body | answers).items():
                operation["responses"].setdefault(status, _problem(description, headers))
            operation["responses"] = dict(sorted(operation["responses"].items()))


def _problem(description: str, headers: dict[str, Any]) -> dict[str, Any]:
    content = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {"description": description, **({"headers": headers} if headers else {}), "content": content}


def _simplified(node: Any) -> Any:
    """Drops pydantic's titles and shortens schemas."""
    if isinstance(node, list):
        return [_simplified(child) for child in node]
    if not isinstance(node, dict):
        return node
    node = {key: _simplified(child) for key, child in node.items()}
    if isinstance(node.get("title"), str):
        del node["title"]
    if isinstance(node.get("description"), str):  # without the ends of docstrings' lines
        node["description"] = re.sub(r"(?<!\n)\n(?!\n)", " ", node["description"])
    if "in" in node and "schema" in node:  # a parameter, whose description FastAPI repeats
        node["schema"].pop("description", None)
        if not node["required"]:
            del node["required"]
    if "$ref" in node and isinstance(node.get("default"), dict):
        node["default"] = {}  # the schema that is referred to has the default of each field
    match node.get("anyOf"):
        case [{"type": str(kind)} as only, {"type": "null"}] if "enum" not in only:
            node.pop("anyOf")
            node |= only | {"type": [kind, "null"]}
    for name, choice in _CHOICES.items():
        if choice.items() <= node.items():
            reference = {"$ref": f"#/components/schemas/{name}"}
            return reference | {key: child for key, child in node.items() if key not in choice}
    return node


def _share(document: dict[str, Any]) -> None:
    """Moves repeated parameters, headers and responses to the components."""
    operations = [operation for path in document["paths"].values() for operation in path.values()]
    responses = [operation["responses"] for operation in operations]
    headers = [response["headers"] for each in responses for response in each.values() if "headers" in response]
    components = document["components"]
    components["parameters"] = _shared("parameters", [operation.get("parameters", []) for operation in operations])
    components["headers"] = _shared("headers", headers)
    components["responses"] = _shared("responses", responses)


def _shared(kind: str, places: Sequence[Any]) -> dict[str, Any]:
    """Replaces repeated entries by references; returns the referenced components."""
    found = [(each, key) for each in places for key in (each if isinstance(each, dict) else range(len(each)))]
    counts = Counter(json.dumps(each[key]) for each, key in found)
    shared: dict[str, Any] = {}
    for each, key in found:
        item = each[key]
        if counts[json.dumps(item)] > 1:
            base = item.get("name") or str(key)
            names = itertools.chain([base], (f"{base}-{number}" for number in itertools.count(2)))
            name = next(name for name in names if shared.setdefault(name, item) == item)
            each[key] = {"$ref": f"#/components/{kind}/{name}"}
    return shared
