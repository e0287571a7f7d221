"""Paging: how many, and from where.

A cursor holds the number of a row, which would tell how many rows all projects have. So it is encrypted, and sealed
against cursors of anybody else's making. The same number gives the same cursor, and so the same page the same body.

Source: SIV, Rogaway and Shrimpton, "Deterministic Authenticated-Encryption" (2006): a keyed hash of the number is its
seal, and what the seal is hashed to covers the number.
"""

import base64
import binascii
import hmac
from typing import Annotated

from fastapi import Query

from risk_sac.config.invalid import shown
from service.api.answers.problems import ProblemError, invalid
from service.schemas.problems import FieldProblem

Limit = Annotated[int, Query(ge=1, le=500, description="Most items on a page.")]
Cursor = Annotated[
    str | None,
    Query(
        max_length=100, description="The `next` of an earlier page of this list, got with a key of the same project."
    ),
]

_NUMBER_BYTES = 8
_SEAL_BYTES = 16


class Cursors:
    """Makes cursors, and reads those that it made for the same list and the same reader."""

    def __init__(self, secret: bytes) -> None:
        self._secret = secret

    def encode(self, number: int | None, listed: str, project: str | None) -> str | None:
        """The cursor for the number of the last item on a page; None for none.

        Args:
          number: of the row, at least 0 and below 2⁶⁴.
          listed: names the list.
          project: the only one that the reader sees; None: all.
        """
        if number is None:
            return None
        plain = number.to_bytes(_NUMBER_BYTES)
        seal = self._seal(plain, listed, project)
        return base64.urlsafe_b64encode(seal + _xor(plain, self._cover(seal))).decode()

    def decode(self, cursor: str | None, listed: str, project: str | None) -> int | None:
        """The number in a cursor; None for none.

        Raises:
          ProblemError: 422, it was not made by `encode` for this list and this reader.
        """
        if cursor is None:
            return None
        try:
            content = base64.b64decode(cursor.encode("ascii"), altchars=b"-_", validate=True)
        except (UnicodeEncodeError, binascii.Error) as error:
            raise _not_ours(cursor) from error
        seal, covered = content[:_SEAL_BYTES], content[_SEAL_BYTES:]
        plain = _xor(covered, self._cover(seal)) if len(covered) == _NUMBER_BYTES else b""
        if not hmac.compare_digest(seal, self._seal(plain, listed, project)):
            raise _not_ours(cursor)
        return int.from_bytes(plain)

    def _seal(self, plain: bytes, listed: str, project: str | None) -> bytes:
        return self._hash("seal", plain, repr((listed, project)).encode())[:_SEAL_BYTES]

    def _cover(self, seal: bytes) -> bytes:
        return self._hash("cover", seal)[:_NUMBER_BYTES]

    def _hash(self, purpose: str, *parts: bytes) -> bytes:
        key = hmac.digest(self._secret, purpose.encode(), "sha256")  # one for each purpose
        return hmac.digest(key, b"".join(parts), "sha256")


def _xor(left: bytes, right: bytes) -> bytes:
    return bytes(a ^ b for a, b in zip(left, right, strict=True))


def _not_ours(cursor: str) -> ProblemError:
    wanted = "the `next` of an earlier page, unchanged"
    detail = f"cursor is {cursor!r}; wanted {wanted}"
    return invalid(detail, FieldProblem(field="cursor", message=detail, got=shown(cursor), wanted=wanted))
