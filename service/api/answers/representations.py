"""What a client wants to have, and whether it has it already."""

import re
from collections.abc import Mapping, Sequence

from fastapi import HTTPException, Request, Response
from pydantic import BaseModel

from risk_sac.records import wire

LEAST_BYTES = 2000  # of what is packed
_QUALITY = re.compile(r"\s*q\s*=\s*([01](?:\.\d{0,3})?)\s*", re.IGNORECASE)


def accepted(accept: str, offered: Sequence[str]) -> str:
    """Returns the offered media type that an Accept header likes best, the first among equals; 406 for none."""
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
    """A tag for a representation; weak, because it names what is shown and not the bytes of the picture."""
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
    """Headers of what may be kept, but is to be asked for again before it is used.

    Args:
      request: which the answer belongs to.
      parts: of the tag; they change whenever the representation does.
      others: headers beside those.

    Raises:
      NotModified: the client has it already.
    """
    headers = {"Cache-Control": "no-cache", "ETag": entity_tag(*parts), **others}
    if has(request, headers["ETag"]):
        raise NotModified(headers)
    return headers


def link(request: Request, path: str) -> str:
    """The path of a route, below the one that a proxy in front has the service at."""
    return str(request.scope.get("root_path", "")) + path


def as_json(record: BaseModel) -> Response:
    """A record as it is answered; FastAPI's own way would write numbers that are not finite as strings."""
    return Response(wire(record), media_type="application/json")
