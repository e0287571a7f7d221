"""How large a body may be."""

from http import HTTPStatus

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.answers.problems import ProblemError
from service.api.guards.refusal import refuse
from service.schemas.problems import Reason
from service.settings import ServiceSettings

UPLOADS = "/v1/networks"


class BodyLimit:
    """ASGI middleware: refuses a body that says it is too large, and stops reading one that turns out to be."""

    def __init__(self, app: ASGIApp, settings: ServiceSettings) -> None:
        self._app = app
        self._body_bytes = settings.max_body_bytes
        self._upload_bytes = settings.max_upload_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes on, with a body that ends in an error where it becomes too large."""
        headers = dict(scope["headers"]) if scope["type"] == "http" else {}
        if b"content-length" not in headers and b"transfer-encoding" not in headers:
            await self._app(scope, receive, send)
            return
        limit = self._upload_bytes if scope["path"].startswith(UPLOADS) else self._body_bytes
        if int(headers.get(b"content-length", 0)) > limit:  # the server has seen to it that it is a number
            await refuse(_too_large(limit), scope, receive, send)
            return
        received, excess = 0, False

        async def limited_receive() -> Message:
            nonlocal received, excess
            message = await receive()
            received += len(message.get("body", b""))
            if received > limit:
                excess = True
                raise _too_large(limit)
            return message

        async def limited_send(message: Message) -> None:
            # What the app makes of the interruption (FastAPI's form parser: a 400) is not the answer.
            if not excess:
                await send(message)

        await self._app(scope, limited_receive, limited_send)
        if excess:
            await refuse(_too_large(limit), scope, receive, send)


def _too_large(limit: int) -> ProblemError:
    detail = f"the body is larger than {limit} bytes; wanted a smaller one"
    return ProblemError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, Reason.TOO_LARGE, detail)
