"""Titles and examples of all calls, for the API's page."""

import inspect
import itertools
import json
import re
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any
from urllib.parse import urlencode

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import TypeAdapter

from risk_sac.config import IID_METHODS, FamilyName, MethodName
from risk_sac.config.methods import RunMethod
from risk_sac.records import Record, StateChange
from service.api.gate import PUBLIC
from service.api.pages import header
from service.api.posted import campaign_schemas, input_schemas
from service.api.problems import ProblemDetails
from service.api.routes.campaigns import PostedTags
from service.api.routes.episodes import PostedTriage
from service.api.routes.reports import PostedRegression

SERVER = "localhost:8000"
PARAMETERS: Mapping[str, str] = {
    "campaign_id": "c197f3a52d8e06b4c",
    "failure_id": "low-archive-0-search-17",
    "run_id": "low-archive-0",
    "network_id": "n0ca7d1f36b2e8450",
    "regression_id": "c197f3a52d8e06b4c-3f9a1c5b7d2e4068",
    "twin": "idle",
    "name": "ecr_low",
    "format": "png",
    "scenario": "bus_pulls_out_aaab21bcb1e7",
}
"""Of what a path has to name."""
QUERIES: Mapping[str, Mapping[str, str]] = {
    "list_campaigns": {"state": "running", "tag": "nightly"},
    "list_episodes": {"outcome": "failure", "limit": "10"},
    "list_failures": {"grade": "preventable", "severity": "severe"},
    "get_curves": {"points": "50"},
    "get_log": {"lines": "20"},
    "get_grid": {"format": "csv"},
    "get_failure_table": {"tier": "valid"},
    "get_events": {"newest": "100"},
    "get_table": {"format": "md"},
    "get_spec": {"format": "yaml"},
    "get_report": {"format": "html"},
    "get_export": {"format": "openscenario"},
    "get_episodes_export": {"format": "parquet"},
    "list_networks": {"limit": "20"},
    "post_network": {"label": "my town"},
}
CAMPAIGN = {"families": ["low"], "methods": ["archive", "random"], "budget": {"episodes": 60}}
CAMPAIGNS = {
    "A quick look": CAMPAIGN,
    "A requirement of your own": CAMPAIGN
    | {"requirements": [{"name": "brakes_gently", "formula": "ego_braking_mps2 <= 4"}]},
    "On an uploaded network": {
        "network": PARAMETERS["network_id"],
        "pattern": "junction",
        "places": "all",
        "methods": ["archive"],
    },
}
SCENARIOS = {
    "A van ahead of the ego": {
        "name": "braking_van",
        "network": "low",
        "parameters": {"gap": {"unit": "m", "range": [20, 50]}},
        "ego": {"start": {"lane": "road_1", "at_m": 200}, "speed": 12},
        "actors": {"van": {"body": "van", "start": {"ahead_of": "ego", "gap_m": "gap"}, "speed": 12}},
    }
}
BODIES: Mapping[str, Mapping[str, Any]] = {
    "post_scenario": SCENARIOS,
    "check_scenario": SCENARIOS,
    "post_campaign": CAMPAIGNS,
    "check_campaign": CAMPAIGNS,
    "put_tags": {"Two tags": {"tags": ["nightly", "release:2.1"]}},
    "put_triage": {"A confirmed failure": {"state": "confirmed", "comment": "late braking, see ticket 12"}},
    "post_regression": {
        "Another ego": {"campaign_id": PARAMETERS["campaign_id"], "ego": {"profile": "careful"}},
    },
}


def describe_calls(paths: dict[str, dict[str, Any]]) -> None:
    """Adds a title and examples to each operation."""
    for path, operations in paths.items():
        for method, operation in operations.items():
            name = operation["operationId"]
            operation["summary"] = title(operation["description"])
            for parameter in operation.get("parameters", []):
                if parameter.get("required"):
                    parameter["example"] = example_of(name, parameter["name"])
            bodies = BODIES.get(name, {})
            content = operation.get("requestBody", {}).get("content", {}).get("application/json")
            if bodies and content is not None:
                content["examples"] = {said: {"value": value} for said, value in bodies.items()}
            operation["description"] += f"\n\nExample: `{command(method, path, name)}`"


def title(description: str) -> str:
    """First clause of a description: what the call does or returns."""
    return re.split(r"[.;:](?:\s|$)", description, maxsplit=1)[0]


def example_of(operation: str, parameter: str) -> str:
    """Returns an example of a parameter in a call of an operation."""
    return QUERIES.get(operation, {}).get(parameter) or PARAMETERS[parameter]


def command(method: str, path: str, name: str) -> str:
    """The call for a shell."""
    query = QUERIES.get(name)
    address = SERVER + path.format(**PARAMETERS) + (f"?{urlencode(query)}" if query else "")
    words = ["curl", "-s", *([] if method == "get" else ["-X", method.upper()]), address]
    if name == "post_network":
        words += ["-H", "content-type: application/xml", "--data-binary", "@town.net.xml"]
    for body in list(BODIES.get(name, {}).values())[:1]:
        words += ["-H", "content-type: application/json", "-d", json.dumps(body)]
    return shlex.join(words)


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
GUARDS: Mapping[int, str] = {
    401: "the API key is missing, wrong or revoked",
    403: "the API key does not reach so far, or the request comes from a foreign page",
    408: "the body comes too slowly",
    413: "the body is too large",
    421: "the Host header names no address of this service",
    429: "too many requests, or too much for the project's quota",
    503: "too many are connected or wait for such an answer, or disk, database or API keys refuse",
}
"""Statuses with which the service may refuse any call, and why."""
_REFUSED = {
    "description": "Refused: " + "; ".join(f"{status}: {reason}" for status, reason in GUARDS.items()),
    "headers": {
        "Retry-After": header("Seconds to wait before asking again, of 429 and 503.", "integer", required=False),
        "WWW-Authenticate": header("`Bearer`, of 401.", required=False),
    },
    "content": {"application/problem+json": {"schema": {"$ref": f"#/components/schemas/{ProblemDetails.__name__}"}}},
}
_CHOICES: dict[str, dict[str, Any]] = {
    "FamilyName": TypeAdapter(FamilyName).json_schema(),
    "MethodName": TypeAdapter(MethodName).json_schema(),
    "RunMethod": TypeAdapter(RunMethod).json_schema(),
}
RUN_METHOD = {"anyOf": [{"$ref": "#/components/schemas/MethodName"}, {"enum": list(IID_METHODS), "type": "string"}]}


def openapi(app: FastAPI) -> dict[str, Any]:
    """The app's OpenAPI document, with every error response declared as a problem."""
    if app.openapi_schema is None:
        app.openapi_schema = _document(app)
    return app.openapi_schema


def _document(app: FastAPI) -> dict[str, Any]:
    document = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes)
    schemas = document["components"]["schemas"]
    schemas |= (
        campaign_schemas()
        | input_schemas(PostedRegression)
        | input_schemas(PostedTriage)
        | input_schemas(PostedTags)
        | _event_schemas()
    )
    for operations in document["paths"].values():
        for operation in operations.values():
            for status, response in operation["responses"].items():
                if response["description"] == "Successful Response":
                    response["description"] = HTTPStatus(int(status)).phrase
                if int(status) >= 400:
                    response["content"] = {"application/problem+json": response["content"]["application/json"]}
    _describe_guards(document)
    document["components"]["schemas"] = _inherited(_simplified(schemas)) | _CHOICES | {"RunMethod": RUN_METHOD}
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
    """Adds the key scheme, and the guards' answer to each operation."""
    document["components"]["securitySchemes"] = _SECURITY
    # Either of them: whether a key is needed depends on the address and the keys of the server.
    document["security"] = [{"ApiKey": []}, {}]
    for path, operations in document["paths"].items():
        for operation in operations.values():
            if path in PUBLIC:
                operation["security"] = []
            operation["responses"] = dict(sorted(operation["responses"].items())) | {"default": _REFUSED}


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
        if "anyOf" in choice and node.get("anyOf") == [*choice["anyOf"], {"type": "null"}]:
            node["anyOf"] = [{"$ref": f"#/components/schemas/{name}"}, {"type": "null"}]
        if choice.items() <= node.items():
            reference = {"$ref": f"#/components/schemas/{name}"}
            return reference | {key: child for key, child in node.items() if key not in choice}
    return node


def _inherited(schemas: dict[str, Any]) -> dict[str, Any]:
    """Returns the schemas, with fields that several records inherit in the base."""
    known = {each.__name__: each for each in _records(Record)}
    records = {name: known[name] for name in schemas if name in known}
    ancestors = [base for each in records.values() for base in each.__mro__[1:]]
    bases = Counter(base for base in ancestors if issubclass(base, Record) and base is not Record)
    for base in (base for base, count in bases.items() if count > 1 and base.__name__ not in schemas):
        first = schemas[next(name for name, each in records.items() if issubclass(each, base))]
        own = {key: first["properties"][key] for key in base.model_fields}
        required = [key for key in first["required"] if key in own]
        about = {"description": inspect.getdoc(base)} if base.__doc__ else {}
        schemas = schemas | {base.__name__: about | {"properties": own, "type": "object", "required": required}}
    return {name: _less_its_base(name, schemas, records) for name in schemas}


def _less_its_base(name: str, schemas: Mapping[str, Any], records: Mapping[str, type[Record]]) -> Any:
    """Returns a schema that refers to its nearest base for inherited fields."""
    schema, record = schemas[name], records.get(name)
    base = next((each.__name__ for each in record.__mro__[1:] if each.__name__ in schemas), None) if record else None
    if base is None or not schemas[base]["properties"].items() <= schema["properties"].items():
        return schema
    own = {key: each for key, each in schema["properties"].items() if key not in schemas[base]["properties"]}
    required = [key for key in schema.get("required", []) if key in own]
    rest = {key: each for key, each in schema.items() if key not in ("properties", "required")}
    reference = {"allOf": [{"$ref": f"#/components/schemas/{base}"}]}
    return rest | reference | ({"properties": own} if own else {}) | ({"required": required} if required else {})


def _records(base: type[Record]) -> set[type[Record]]:
    """Returns the classes that derive from a record, at any distance."""
    return {each for own in base.__subclasses__() for each in (own, *_records(own))}


def _share(document: dict[str, Any]) -> None:
    """Moves repeated parameters, bodies, headers and responses to the components."""
    operations = [operation for path in document["paths"].values() for operation in path.values()]
    responses = [operation["responses"] for operation in operations]
    headers = [response["headers"] for each in responses for response in each.values() if "headers" in response]
    components = document["components"]
    components["parameters"] = _shared("parameters", [operation.get("parameters", []) for operation in operations])
    components["headers"] = _shared("headers", headers)
    components["requestBodies"] = _shared("requestBodies", operations, ("requestBody",))
    components["responses"] = _shared("responses", responses)


def _shared(kind: str, places: Sequence[Any], only: Sequence[str] = ()) -> dict[str, Any]:
    """Replaces repeated entries (`only` these keys) by references; returns the components."""
    entries = [(place, key) for place in places for key in (place if isinstance(place, dict) else range(len(place)))]
    entries = [(place, key) for place, key in entries if not only or key in only]
    counts = Counter(json.dumps(place[key], sort_keys=True) for place, key in entries)
    shared: dict[str, Any] = {}
    for place, key in entries:
        item = place[key]
        if counts[json.dumps(item, sort_keys=True)] > 1:
            base = item.get("name") or str(key)
            names = itertools.chain([base], (f"{base}-{number}" for number in itertools.count(2)))
            name = next(name for name in names if shared.setdefault(name, item) == item)
            place[key] = {"$ref": f"#/components/{kind}/{name}"}
    return shared
