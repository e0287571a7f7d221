"""Content negotiation and conditional requests."""

import re
from collections.abc import Mapping, Sequence

from fastapi import HTTPException, Request, Response
from pydantic import BaseModel

from risk_sac.records import wire

LEAST_BYTES = 2000  # of what is packed
_QUALITY = re.compile(r"\s*q\s*=\s*([01](?:\.\d{0,3})?)\s*", re.IGNORECASE)


def accepted(accept: str, offered: Sequence[str]) -> str:
    """Returns the best offered media type for an Accept header, the first of equals; else 406."""
    liked = dict(_range(part) for part in accept.split(",") if part.strip()) or {"*/*": 1.0}

    def quality(media_type: str) -> float:
        """Of the most specific range that includes it."""
        ranges = (media_type, f"{media_type.partition('/')[0]}/*", "*/*")
        return next((liked[name] for name in ranges if name in liked), 0.0)

    best = max(offered, key=quality)
    if not quality(best):
        raise HTTPException(406, f"accept is {accept!r}; wanted one of {', '.join(offered)}")
    return best


def takes(accept_encoding: str, encoding: str) -> bool:
    """Whether an Accept-Encoding header names an encoding, and not to refuse it."""
    return dict(map(_range, accept_encoding.split(","))).get(encoding, 0.0) > 0.0


def _range(part: str) -> tuple[str, float]:
    """`text/*;q=0.5` -> ("text/*", 0.5)."""
    name, *parameters = part.split(";")
    qualities = (match for match in map(_QUALITY.fullmatch, parameters) if match)
    return name.strip().lower(), float(next((match[1] for match in qualities), 1.0))


def entity_tag(*parts: str) -> str:
    """Returns a weak tag, since it identifies the content and not the bytes."""
    return f'W/"{"-".join(parts)}"'


def has(request: Request, tag: str) -> bool:
    """Whether the client says that it has the representation with this tag."""
    given = [each.strip().removeprefix("W/") for each in request.headers.get("if-none-match", "").split(",")]
    return "*" in given or tag.removeprefix("W/") in given


class NotModified(Exception):
    """The client has the representation; the answer is a 304 with `headers`."""

    def __init__(self, headers: Mapping[str, str]) -> None:
        super().__init__(headers)
        self.headers = headers


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
    """Returns a record as JSON; FastAPI would write numbers that are not finite as strings."""
    return Response(wire(record), media_type="application/json")
