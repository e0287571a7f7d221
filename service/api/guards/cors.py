"""Cross-origin requests of web pages that the operator names."""

from starlette.datastructures import Headers
from starlette.middleware.cors import CORSMiddleware
from starlette.responses import Response
from starlette.types import ASGIApp

METHODS = ("GET", "POST", "PUT", "DELETE")
REQUEST_HEADERS = ("Authorization", "Content-Type", "Idempotency-Key", "If-None-Match", "Last-Event-ID")
RESPONSE_HEADERS = ("ETag", "Location", "Retry-After")


class Cors(CORSMiddleware):
    """Starlette's middleware, set up for this API.

    Keys travel in a header that a page must know, never in cookies, so credentials are not allowed.
    """

    def __init__(self, app: ASGIApp, origins: list[str]) -> None:
        super().__init__(
            app,
            allow_origins=origins,
            allow_methods=METHODS,
            allow_headers=REQUEST_HEADERS,
            expose_headers=RESPONSE_HEADERS,
        )

    def preflight_response(self, request_headers: Headers) -> Response:
        """What a browser asks before it sends the request itself: it looks at headers only, so there is no body."""
        answer = super().preflight_response(request_headers)
        headers = {
            name: value for name, value in answer.headers.items() if name not in ("content-length", "content-type")
        }
        return Response(status_code=204 if answer.status_code == 200 else 403, headers=headers)
