"""How large a body may be, and how slowly it may come."""

import asyncio
import time
from http import HTTPStatus

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.answers.problems import ProblemError
from service.api.guards.refusal import refuse
from service.schemas.problems import Reason
from service.settings import ServiceSettings

UPLOADS = "/v1/networks"


class BodyLimit:
    """ASGI middleware: refuses a body that says it is too large, and stops reading one that is, or comes too slowly."""

    def __init__(self, app: ASGIApp, settings: ServiceSettings) -> None:
        self._app = app
        self._body_bytes = settings.max_body_bytes
        self._upload_bytes = settings.max_upload_bytes
        self._bytes_per_s = settings.min_body_rate
        self._patience_s = settings.body_patience_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes on, with a body that ends in an error where it is refused."""
        headers = dict(scope["headers"]) if scope["type"] == "http" else {}
        if b"content-length" not in headers and b"transfer-encoding" not in headers:
            await self._app(scope, receive, send)
            return
        limit = self._upload_bytes if scope["path"].startswith(UPLOADS) else self._body_bytes
        if int(headers.get(b"content-length", 0)) > limit:  # the server has seen to it that it is a number
            await refuse(_too_large(limit), scope, receive, send)
            return
        received, waited_s, complete = 0, 0.0, False
        refusal: ProblemError | None = None

        async def limited_receive() -> Message:
            nonlocal received, waited_s, complete, refusal
            if complete:  # what is waited for now is that the client leaves
                return await receive()
            began = time.monotonic()
            try:
                async with asyncio.timeout(self._patience_s + received / self._bytes_per_s - waited_s):
                    message = await receive()
            except TimeoutError as error:
                refusal = self._too_slow()
                raise refusal from error
            waited_s += time.monotonic() - began  # without the time that the service takes itself
            received += len(message.get("body", b""))
            complete = not message.get("more_body", False)
            if received > limit:
                refusal = _too_large(limit)
                raise refusal
            return message

        async def limited_send(message: Message) -> None:
            # What the app makes of the interruption (FastAPI's form parser: a 400) is not the answer.
            if refusal is None:
                await send(message)

        await self._app(scope, limited_receive, limited_send)
        if refusal is not None:
            await refuse(refusal, scope, receive, send)

    def _too_slow(self) -> ProblemError:
        detail = (
            f"the body comes more slowly than {self._bytes_per_s} bytes per second, for more than "
            f"{self._patience_s:g} s; wanted it faster"
        )
        headers = {"Connection": "close"}  # nobody waits for the rest
        return ProblemError(HTTPStatus.REQUEST_TIMEOUT, Reason.UPLOAD_TOO_SLOW, detail, headers=headers)


def _too_large(limit: int) -> ProblemError:
    detail = f"the body is larger than {limit} bytes; wanted a smaller one"
    return ProblemError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, Reason.TOO_LARGE, detail)
