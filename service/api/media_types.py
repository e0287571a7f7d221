"""What a body is, as its headers say: read once, the same way for every route that takes one."""

from collections.abc import Collection
from http import HTTPStatus

from fastapi import Request

from service.api.answers.problems import ProblemError
from service.schemas.problems import Reason


def media_type(request: Request, wanted: Collection[str]) -> str:
    """The media type of a body.

    Args:
      request: which has the body.
      wanted: media types that the route reads, the one to recommend first.

    Raises:
      ProblemError: 415, it is none of them, or the body is packed for the way.
    """
    given = request.headers.get("content-type", "")
    declared = given.partition(";")[0].strip().lower()
    if declared not in wanted:
        example = f"curl -H 'content-type: {next(iter(wanted))}' --data-binary @FILE"
        detail = (
            f"content-type is {given[:100]!r}; wanted {' or '.join(wanted)}: send the file alone, as in `{example}`"
        )
        raise _unsupported(detail)
    encoding = request.headers.get("content-encoding", "identity")
    if encoding.strip().lower() != "identity":
        raise _unsupported(f"content-encoding is {encoding[:100]!r}; wanted none: send the body as it is")
    return declared


def _unsupported(detail: str) -> ProblemError:
    return ProblemError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, Reason.UNSUPPORTED_MEDIA_TYPE, detail)
