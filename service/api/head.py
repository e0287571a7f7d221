"""HEAD is answered as GET would be, without the body."""

from starlette.types import ASGIApp, Message, Receive, Scope, Send


class Head:
    """ASGI middleware: has the app answer a GET, and ends the answer where its body would begin.

    A stream would never end by itself, so the app is told that the client has left.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes on."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self._app(scope, receive, send)
            return
        asked, answered = {**scope, "method": "GET"}, False

        async def receive_until_answered() -> Message:
            return {"type": "http.disconnect"} if answered else await receive()

        async def send_head(message: Message) -> None:
            nonlocal answered
            if answered:
                return
            answered = message["type"] == "http.response.start"
            scope.update(asked | {"method": "HEAD"})  # the router and the gate leave in it what the log tells
            await send(message)
            if answered:
                await send({"type": "http.response.body"})

        await self._app(asked, receive_until_answered, send_head)
