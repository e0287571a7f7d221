"""Parameters, headers and declared responses that routes share.

A cursor holds a row's number, which would reveal the number of rows of all projects. So it is encrypted with
deterministic authentication: the same page has the same body.
"""

import base64
import binascii
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESSIV
from fastapi import Query, Request, Response
from pydantic import BaseModel

from risk_sac.records import Outcome, wire
from service.api.problems import RETRIED, NotModified, ProblemDetails, invalid_field

Limit = Annotated[int, Query(ge=1, le=500, description="Most items on a page.")]
Cursor = Annotated[
    str | None,
    Query(
        max_length=100, description="The `next` of an earlier page of this list, got with a key of the same project."
    ),
]
TIERS = {"valid": (Outcome.FAILURE,), "raw": (Outcome.FAILURE, Outcome.DEGENERATE)}
Tier = Annotated[Literal["valid", "raw"], Query(description="`raw` adds episodes whose violations a rule refused.")]


class Cursors:
    """Makes cursors, and reads its own for the same list and reader."""

    def __init__(self, secret: bytes) -> None:
        self._cipher = AESSIV(secret)

    def encode(self, number: int | None, listed: str, project: str | None) -> str | None:
        """Makes the cursor after an item, bound to list and reader."""
        if number is None:
            return None
        return base64.urlsafe_b64encode(self._cipher.encrypt(number.to_bytes(8), _bound(listed, project))).decode()

    def decode(self, cursor: str | None, listed: str, project: str | None) -> int | None:
        """Returns a cursor's number; 422 unless made for this list and reader."""
        if cursor is None:
            return None
        try:
            content = base64.b64decode(cursor.encode("ascii"), altchars=b"-_", validate=True)
            return int.from_bytes(self._cipher.decrypt(content, _bound(listed, project)))
        except (UnicodeEncodeError, binascii.Error, InvalidTag) as error:
            raise invalid_field("cursor", cursor, "the `next` of an earlier page, unchanged") from error


def _bound(listed: str, project: str | None) -> list[bytes]:
    """Returns the context that a cursor is bound to."""
    return [repr((listed, project)).encode()]


def entity_tag(*parts: str) -> str:
    """Returns a weak tag: it identifies the content, not the bytes."""
    return f'W/"{"-".join(parts)}"'


def has(request: Request, tag: str) -> bool:
    """Whether the client says that it has the representation with this tag."""
    given = [value.strip().removeprefix("W/") for value in request.headers.get("if-none-match", "").split(",")]
    return "*" in given or tag.removeprefix("W/") in given


def cacheable(request: Request, *parts: str, others: Mapping[str, str] = {}) -> dict[str, str]:
    """Returns headers of an answer that clients may store but must revalidate.

    Args:
      request: of the answer.
      parts: of the tag; they change whenever the representation does.
      others: headers beside those.

    Raises:
      NotModified: the client's copy is current.
    """
    headers = {"Cache-Control": "no-cache", "ETag": entity_tag(*parts), **others}
    if has(request, headers["ETag"]):
        raise NotModified(headers)
    return headers


def link(request: Request, path: str) -> str:
    """Returns the path of a route with the proxy's prefix."""
    return str(request.scope.get("root_path", "")) + path


def as_json(record: BaseModel) -> Response:
    """Returns a record as JSON, with null for non-finite numbers."""
    return Response(wire(record), media_type="application/json")


Responses = dict[int | str, dict[str, Any]]


def header(description: str, type_: str = "string", *, required: bool = True) -> dict[str, Any]:
    """A header of a response."""
    return {"description": description, "schema": {"type": type_}} | ({"required": True} if required else {})


WAIT = {"Retry-After": header("Seconds to wait before asking again.", "integer")}


def problem(status: int, description: str) -> Responses:
    """A response that is a problem."""
    return {
        status: {"model": ProblemDetails, "description": description} | ({"headers": WAIT} if status in RETRIED else {})
    }


MALFORMED = problem(400, "The body is no JSON")
UNKNOWN = problem(404, "Nothing has this id")
REUSED = problem(409, "The idempotency key has queued another campaign")
NOT_ENDED = problem(409, "The campaign has not ended")
WRONG_TYPE = problem(415, "The body is declared as something else, or carries a Content-Encoding")
INVALID = problem(422, "A field is wrong; `errors` names it")
STOPPED = problem(503, "Campaigns make no progress")
UNREADY = problem(503, "The disk or the database refuses")

_RETRY = {
    "Retry-After": header(
        "Seconds to wait: a twentieth of the time left; absent once the campaign has ended.", "integer", required=False
    )
}
_TAGGED = {
    "ETag": header(
        "Changes whenever the body does; ask with If-None-Match. Absent where a finished run's folder cannot be read.",
        required=False,
    )
}


def _tagged(headers: dict[str, Any]) -> Responses:
    return {
        200: {"headers": headers},
        304: {"description": "What If-None-Match names still holds", "headers": headers},
    }


TAGGED = _tagged(_TAGGED)
LIVE = _tagged(_TAGGED | _RETRY)
ACCEPTED: Responses = {202: {"headers": {"Location": header("Where to follow it.")} | _RETRY}}
