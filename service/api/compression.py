"""Large answers of text travel packed to whoever can unpack them: a table of numbers takes a fifth of the room."""

from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.gzip import GZipMiddleware
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.answers.representations import takes

LEAST_BYTES = 2000  # of what is packed
LEVEL = 4  # of 9; those above take several times as long for a few hundredths less


class Compression:
    """ASGI middleware, in front of the cache of answers, which keeps them as they are.

    Starlette leaves alone what is packed already, pictures and files among it, and streams of events. The tags of
    answers are weak, and so hold for both forms.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._packing = GZipMiddleware(app, minimum_size=LEAST_BYTES, compresslevel=LEVEL)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes on, and packs the answer."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_with_vary(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(raw=message["headers"])
                # Of all that may be kept: a 304 says the same as what still holds, and does not know whether that was
                # packed.
                if "etag" in headers and "Accept-Encoding" not in headers.get("vary", ""):
                    headers.add_vary_header("Accept-Encoding")
                if headers.get("content-encoding") == "gzip" and headers.get("etag", "W/")[:2] != "W/":
                    headers["etag"] = f"W/{headers['etag']}"  # a file's own tag is that of its bytes
            await send(message)

        # Starlette looks for the word alone, in small letters, and would not see that it is refused.
        packs = takes(", ".join(Headers(scope=scope).getlist("accept-encoding")), "gzip")
        others = [each for each in scope["headers"] if each[0] != b"accept-encoding"]
        scope["headers"] = [*others, (b"accept-encoding", b"gzip")] if packs else others
        await self._packing(scope, receive, send_with_vary)
