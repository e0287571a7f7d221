"""Paging: how many, and from where."""

import base64
import binascii
from typing import Annotated

from fastapi import Query

from service.errors import CursorError

Limit = Annotated[int, Query(ge=1, le=500, description="Most items on a page.")]
Cursor = Annotated[str | None, Query(max_length=100, description="The `next` of an earlier page.")]

_LARGEST = 2**63 - 1  # of a database key


def encode_cursor(number: int | None) -> str | None:
    """An opaque cursor for the number of the last item on a page."""
    return None if number is None else base64.urlsafe_b64encode(str(number).encode()).decode()


def decode_cursor(cursor: str | None) -> int | None:
    """The number in a cursor.

    Raises:
      CursorError: the cursor was not issued by `encode_cursor`.
    """
    if cursor is None:
        return None
    try:
        number = int(base64.b64decode(cursor.encode("ascii"), altchars=b"-_", validate=True))
    except (UnicodeEncodeError, binascii.Error, ValueError) as error:
        raise CursorError(cursor) from error
    if not 0 < number <= _LARGEST:
        raise CursorError(cursor)
    return number
