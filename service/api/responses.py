"""Error responses as the API's description declares them."""

from typing import Any

from service.schemas import Problem

Responses = dict[int | str, dict[str, Any]]


def _problem(status: int, description: str) -> Responses:
    return {status: {"model": Problem, "description": description}}


MALFORMED = _problem(400, "The body is no JSON")
UNACCEPTABLE = _problem(406, "The Accept header names none of the media types there are")
NOT_JSON = _problem(415, "The body is not declared as application/json")
UNKNOWN = _problem(404, "Nothing has this id")
INVALID = _problem(422, "A field is wrong; `errors` names it")
STORAGE = _problem(503, "The database cannot be read or written")
STOPPED = _problem(503, "Campaigns make no progress")
