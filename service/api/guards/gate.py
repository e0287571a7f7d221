"""Whom the service lets in, decided before a body is read and before a route is looked up.

A route that is added tomorrow is therefore guarded today: it wants a key unless `PUBLIC` or `PAGE` names it.
"""

from collections.abc import Mapping
from http import HTTPStatus

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.access import CALLER, LOCAL, Caller, check_scope
from service.api.answers.problems import ProblemError
from service.api.guards.hosts import Hosts
from service.api.guards.origins import SAFE, Origins
from service.api.guards.rate import RateLimit
from service.api.guards.refusal import refuse
from service.errors import KeysError
from service.keys.exposure import is_loopback
from service.keys.file import REMEDY
from service.keys.key import Scope as KeyScope
from service.keys.made import KeysMade
from service.keys.ring import KeyRing
from service.schemas.problems import Reason
from service.settings import ServiceSettings

HEALTH = frozenset({"/healthz", "/readyz"})
_PAGE = {"/docs", "/docs/swagger-ui-bundle.js", "/docs/swagger-ui.css", "/docs/favicon.png"}
PUBLIC = HEALTH | _PAGE | {"/", "/openapi.json", "/page"}
PAGE = "/page/"  # and what lies below: it asks for the key itself

RequestHeaders = Mapping[bytes, bytes]


class Gate:
    """ASGI middleware: host, origin, key, rate and scope, in this order."""

    def __init__(self, app: ASGIApp, settings: ServiceSettings, made: KeysMade) -> None:
        self._app = app
        self._hosts = Hosts([*settings.allowed_hosts, settings.host])
        self._origins = Origins(settings.cors_origins)
        self._rate = RateLimit(settings.rate_limit)
        self._keys = KeyRing(settings.keys_file, made)
        self._keyless = is_loopback(settings.host)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes on what may come in, and answers the rest itself."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        try:
            self._check(scope, headers)
        except ProblemError as error:
            await refuse(error, scope, receive, send)
            return
        caller, ended = scope.get(CALLER), False

        async def send_while_let_in(message: Message) -> None:
            nonlocal ended
            if ended:
                return
            if message.get("more_body") and caller is not None and not self._still(caller, headers):
                ended, message = True, {"type": "http.response.body"}  # of a stream that its key does not outlive
            await send(message)

        await self._app(scope, receive, send_while_let_in)

    def _check(self, scope: Scope, headers: RequestHeaders) -> None:
        """Lets the caller in.

        Raises:
          ProblemError: or does not.
        """
        self._hosts.check(scope, headers)
        self._origins.check(scope, headers)
        path, method = scope["path"], scope["method"]
        if path in HEALTH:  # not counted, or a flood from one address would make the service look ill
            return
        address = scope["client"][0] if scope.get("client") else ""
        if path in PUBLIC or path.startswith(PAGE):
            self._rate.count("address", address)
            return
        try:
            caller = self._caller(headers)
        except ProblemError:
            self._rate.count("address", address)  # guesses too
            raise
        if caller.key_id is None:
            self._rate.count("address", address)
        else:
            self._rate.count("key", caller.key_id)
        check_scope(caller, KeyScope.READ if method in SAFE else KeyScope.RUN)
        scope[CALLER] = caller

    def _still(self, caller: Caller, headers: RequestHeaders) -> bool:
        try:
            return self._caller(headers) == caller
        except ProblemError:
            return False

    def _caller(self, headers: RequestHeaders) -> Caller:
        """Who holds the key that a request carries.

        Raises:
          ProblemError: 401, or 503 where that cannot be known.
        """
        try:
            if self._keys.open and self._keyless:
                return LOCAL
            scheme, _, token = headers.get(b"authorization", b"").decode("latin-1").partition(" ")
            key = self._keys.find(token.strip()) if scheme.lower() == "bearer" else None
        except KeysError as error:
            detail = f"the API keys are lost or damaged, so nobody is let in; whoever runs the service: {REMEDY}"
            raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.KEYS_UNAVAILABLE, detail) from error
        if key is None:
            given = "not one that counts" if scheme else "missing"
            detail = f"the API key is {given}; wanted the header `Authorization: Bearer KEY`"
            raise ProblemError(
                HTTPStatus.UNAUTHORIZED, Reason.UNAUTHORIZED, detail, headers={"WWW-Authenticate": "Bearer"}
            )
        return Caller(key.project, key.scope, key.id)
