"""Authorises requests before a body is read and before routing.

So a new route is guarded by default: it requires a key unless `PUBLIC` or `PAGE` names it.
"""

import re
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from http import HTTPStatus

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from risk_sac.host.machine import is_loopback
from service.api.connections import most_connections
from service.api.context import CALLER, LOCAL, Caller, check_scope
from service.api.problems import ProblemError, Reason, problem_response, route_path
from service.errors import KeysError
from service.keys import REMEDY, KeyRing, fair_share
from service.keys import Scope as KeyScope
from service.settings import ServiceSettings

CREATE = "which `risk-sac keys create` makes"
SAFE = frozenset({"GET", "HEAD", "OPTIONS"})  # methods that change nothing
HEALTH = frozenset({"/healthz", "/readyz"})
_PAGE = {"/docs", "/docs/swagger-ui-bundle.js", "/docs/swagger-ui.css", "/docs/favicon.png"}
PUBLIC = HEALTH | _PAGE | {"/", "/openapi.json", "/page"}
PAGE = "/page/"  # and what lies below: it asks for the key itself
_HOST = re.compile(r"(?:\[(?P<address>[0-9a-f:.]+)\]|(?P<name>[^:\[\]]*))(?::\d*)?")

RequestHeaders = Mapping[bytes, bytes]


class Gate:
    """ASGI middleware: checks host, origin, key, rate, scope and share, in order."""

    def __init__(self, app: ASGIApp, settings: ServiceSettings) -> None:
        self._app = app
        self._hosts = allowed_hosts([*settings.allowed_hosts, settings.host])
        self._origins = frozenset(origin.lower() for origin in settings.cors_origins)
        self._rate = RateLimit(settings.rate_limit)
        self._keys = KeyRing(settings.keys_file)
        self._shares = Shares(most_connections(settings))
        self._keyless = is_loopback(settings.host)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes on what may come in, and answers the rest itself."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        try:
            self._check(scope, headers)
            caller: Caller | None = scope.get(CALLER)
            key_id = None if caller is None else caller.key_id
            self._shares.take(key_id)
        except ProblemError as error:
            await problem_response(scope["path"], error)(scope, receive, send)
            return
        ended = False

        async def send_while_let_in(message: Message) -> None:
            nonlocal ended
            if ended:
                return
            if message.get("more_body") and caller is not None and not self._still(scope, caller, headers):
                ended, message = True, {"type": "http.response.body"}  # of a stream that its key does not outlive
            await send(message)

        try:
            await self._app(scope, receive, send_while_let_in)
        finally:
            self._shares.give_back(key_id)

    def _check(self, scope: Scope, headers: RequestHeaders) -> None:
        """Lets the caller in, or raises ProblemError."""
        check_host(scope, headers, self._hosts)
        check_origin(scope["method"], headers, self._origins)
        path, method = route_path(scope), scope["method"]
        if path in HEALTH:  # not counted, or a flood from one address would make the service look ill
            return
        address = _address(scope)
        if path in PUBLIC or path.startswith(PAGE):
            self._rate.count("address", address)
            return
        try:
            caller = self._caller(scope, headers)
        except ProblemError:
            self._rate.count("address", address)  # guesses too
            raise
        if caller.key_id is None:
            self._rate.count("address", address)
        else:
            self._rate.count("key", caller.key_id)
        check_scope(caller, KeyScope.READ if method in SAFE else KeyScope.RUN)
        scope[CALLER] = caller

    def _still(self, scope: Scope, caller: Caller, headers: RequestHeaders) -> bool:
        try:
            return self._caller(scope, headers) == caller
        except ProblemError:
            return False

    def _caller(self, scope: Scope, headers: RequestHeaders) -> Caller:
        """Returns the caller by key or address; raises 401 or 503."""
        try:
            keyless = self._keys.open and self._keyless
            if keyless and not (abroad := _remote_clients(scope)):
                return LOCAL
            scheme, _, token = headers.get(b"authorization", b"").decode("latin-1").partition(" ")
            key = self._keys.find(token.strip()) if scheme.lower() == "bearer" else None
        except KeysError as error:
            detail = f"the API keys are lost or damaged, so calls are refused; the operator has to {REMEDY}"
            raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.KEYS_UNAVAILABLE, detail) from error
        if key is None:
            given = "not one that counts" if scheme else "missing"
            detail = f"the API key is {given}; wanted the header `Authorization: Bearer KEY`"
            if keyless:
                detail = f"the client is at {abroad[0][:100]}; wanted a loopback address, or an API key, {CREATE}"
            raise ProblemError(
                HTTPStatus.UNAUTHORIZED, Reason.UNAUTHORIZED, detail, headers={"WWW-Authenticate": "Bearer"}
            )
        return Caller(key.project, key.scope, key.id)


def _remote_clients(scope: Scope) -> list[str]:
    """Returns a request's non-loopback addresses: its client's and those proxies state.

    A client may forge the first of them, and a proxy that is not trusted states the client's, too.
    """
    stated = ",".join(Headers(scope=scope).getlist("x-forwarded-for"))
    addresses = [_address(scope), *filter(None, map(str.strip, stated.split(",")))]
    return [address for address in addresses if not is_loopback(address)]


def _address(scope: Scope) -> str:
    """Returns the address of the client, as a trusted proxy states it."""
    return scope["client"][0] if scope.get("client") else ""


class RateLimit:
    """Counter of the requests of each key or keyless address per second."""

    def __init__(self, per_second: int) -> None:
        self._per_second = per_second
        self._window = 0
        self._counts = Counter[tuple[str, ...]]()

    def count(self, *caller: str) -> None:
        """Counts a request; refuses it where there are too many."""
        window = int(time.monotonic())
        if window != self._window:
            self._window = window
            self._counts.clear()
        self._counts[caller] += 1
        if self._counts[caller] > self._per_second:
            detail = f"rate is more than {self._per_second} requests per second; wanted fewer: wait 1 s"
            headers = {"Connection": "close"}  # and what else the connection has queued is dropped
            raise ProblemError(HTTPStatus.TOO_MANY_REQUESTS, Reason.RATE_LIMITED, detail, headers=headers, retry_s=1)


class Shares:
    """Bound on the open requests of each key."""

    def __init__(self, connections: int) -> None:
        self._connections = connections
        self._open = Counter[str]()

    def take(self, key_id: str | None) -> None:
        """Counts a request; refuses it if its key has its share."""
        if key_id is None:
            return
        share = fair_share(self._connections, len(self._open.keys() | {key_id}))
        if self._open[key_id] >= share:
            detail = f"this key has {share} requests open, its share of the connections; wanted fewer: wait 1 s"
            raise ProblemError(HTTPStatus.TOO_MANY_REQUESTS, Reason.CONNECTIONS_BUSY, detail, retry_s=1)
        self._open[key_id] += 1

    def give_back(self, key_id: str | None) -> None:
        """Counts the end of a request."""
        if key_id is not None:
            self._open[key_id] -= 1
            self._open += Counter()  # without keys that have none open


def allowed_hosts(hosts: Iterable[str]) -> frozenset[str]:
    """Names of hosts, as `check_host` compares them."""
    return frozenset(map(_host_name, hosts))


def check_host(scope: Scope, headers: RequestHeaders, allowed: frozenset[str]) -> None:
    """Refuses a foreign Host, as in DNS rebinding.

    Not Starlette's TrustedHostMiddleware: any address that the connection was made to is allowed, and a refusal is a
    problem.
    """
    given = headers.get(b"host", b"").decode("latin-1")
    server = scope.get("server")
    reached_at = None if server is None else server[0].lower().removeprefix("::ffff:")  # IPv4 on a socket for both
    if "*" in allowed or _host_name(given) in {*allowed, reached_at}:
        return
    detail = f"host is {given!r}; wanted one of {', '.join(sorted(allowed))}: RISK_SAC_ALLOWED_HOSTS adds to them"
    raise ProblemError(HTTPStatus.MISDIRECTED_REQUEST, Reason.UNKNOWN_HOST, detail)


def _host_name(host: str) -> str:
    """Returns a host without port and brackets of IPv6: `[::1]:8000` -> `::1`."""
    host = host.lower()
    parts = _HOST.fullmatch(host)
    return host if parts is None else parts["address"] or parts["name"]


def check_origin(method: str, headers: RequestHeaders, allowed: frozenset[str]) -> None:
    """Refuses changes by foreign web pages; programs send no Origin."""
    given = headers.get(b"origin")
    if given is None or "*" in allowed or method in SAFE:
        return
    origin = given.decode("latin-1").lower()
    # Without the scheme, which a proxy in front may have changed; the host has been checked.
    if origin in allowed or origin.partition("://")[2] == headers.get(b"host", b"").decode("latin-1").lower():
        return
    detail = f"origin is {origin!r}; wanted the service's own, or one that RISK_SAC_CORS_ORIGINS names"
    raise ProblemError(HTTPStatus.FORBIDDEN, Reason.FOREIGN_ORIGIN, detail)
