"""What the guards answer, as the API's description declares it: the same for all routes, so said in one place."""

from typing import Any

from service.api.guards.gate import HEALTH, PUBLIC

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


def describe_guards(document: dict[str, Any]) -> None:
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
