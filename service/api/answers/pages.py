"""Query parameters that lists share: limit, cursor and filters.

A cursor holds a row's number, which would reveal the number of rows of all projects. So it is encrypted with
deterministic authentication: the same page has the same body.
"""

import base64
import binascii
from typing import Annotated, Literal

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESSIV
from fastapi import Query

from risk_sac.records import Outcome
from service.api.answers.problems import invalid_field

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
        """Makes the cursor after a page's last item, for one list and reader."""
        if number is None:
            return None
        return base64.urlsafe_b64encode(self._cipher.encrypt(number.to_bytes(8), _bound(listed, project))).decode()

    def decode(self, cursor: str | None, listed: str, project: str | None) -> int | None:
        """Reads the number in a cursor; 422 unless `encode` made it for this list and reader."""
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
