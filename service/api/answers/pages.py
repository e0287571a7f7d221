"""Paging: how many, and from where."""

import base64
from typing import Annotated

from fastapi import Query

from service.api.answers.fields import shown
from service.api.answers.problems import invalid
from service.schemas.problems import FieldProblem

Limit = Annotated[int, Query(ge=1, le=500, description="Most items on a page.")]
Cursor = Annotated[str | None, Query(max_length=100, description="The `next` of an earlier page.")]

_LARGEST = 2**63 - 1  # of a database key


def encode_cursor(number: int | None) -> str | None:
    """An opaque cursor for the number of the last item on a page."""
    return None if number is None else base64.urlsafe_b64encode(str(number).encode()).decode()


def decode_cursor(cursor: str | None) -> int | None:
    """The number in a cursor.

    Raises:
      ProblemError: 422, the cursor was not issued by `encode_cursor`.
    """
    if cursor is None:
        return None
    try:
        number = int(base64.b64decode(cursor.encode("ascii"), altchars=b"-_", validate=True))
    except ValueError:  # binascii's and those of the encoding are, too
        number = 0
    if not 0 < number <= _LARGEST:
        wanted = "the `next` of an earlier page, unchanged"
        detail = f"cursor is {cursor!r}; wanted {wanted}"
        raise invalid(detail, FieldProblem(field="cursor", message=detail, got=shown(cursor), wanted=wanted))
    return number
