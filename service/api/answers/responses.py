"""Responses as the API's description declares them."""

from typing import Any

from service.api.answers.problems import RETRIED, Problem

Responses = dict[int | str, dict[str, Any]]


def header(description: str, type_: str = "string", *, required: bool = True) -> dict[str, Any]:
    """A header of a response."""
    return {"description": description, "schema": {"type": type_}} | ({"required": True} if required else {})


WAIT = {"Retry-After": header("Seconds to wait before asking again.", "integer")}


def problem(status: int, description: str) -> Responses:
    """A response that is a problem."""
    return {status: {"model": Problem, "description": description} | ({"headers": WAIT} if status in RETRIED else {})}


MALFORMED = problem(400, "The body is no JSON")
UNKNOWN = problem(404, "Nothing has this id")
UNACCEPTABLE = problem(406, "The Accept header names none of the media types there are")
REUSED = problem(409, "The idempotency key has queued another campaign")
NOT_ENDED = problem(409, "The campaign has not ended")
NOT_JSON = problem(415, "The body is declared as something else than application/json, or carries a Content-Encoding")
INVALID = problem(422, "A field is wrong; `errors` names it")
STORAGE = problem(503, "The database cannot be read or written")
STOPPED = problem(503, "Campaigns make no progress")
UNREADY = problem(503, "The disk or the database refuses")

CROWDED = problem(503, "The database cannot be read, or too many wait for theirs")
_RETRY = {
    "Retry-After": header(
        "Seconds to wait: a twentieth of the time left; absent once the campaign has ended.", "integer", required=False
    )
}
_TAGGED = {
    "ETag": header("Changes whenever the body does."),
    "Cache-Control": header("`no-cache`: keep it, and ask with If-None-Match."),
}


def _tagged(headers: dict[str, Any]) -> Responses:
    return {
        200: {"headers": headers},
        304: {"description": "What If-None-Match names still holds", "headers": headers},
    }


TAGGED = _tagged(_TAGGED)
LIVE = _tagged(_TAGGED | _RETRY)
ACCEPTED: Responses = {202: {"headers": {"Location": header("Where to follow it.")} | _RETRY}}
