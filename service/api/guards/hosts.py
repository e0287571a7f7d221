"""The Host header: a web page that rebinds its own name to this address must not get an answer."""

import re
from collections.abc import Iterable, Mapping
from http import HTTPStatus

from starlette.types import Scope

from service.api.answers.problems import ProblemError
from service.schemas.problems import Reason

_HOST = re.compile(r"(?:\[(?P<address>[0-9a-f:.]+)\]|(?P<name>[^:\[\]]*))(?::\d*)?")


class Hosts:
    """Names under which the service answers: those that it was told, and any address that it was reached at."""

    def __init__(self, allowed: Iterable[str]) -> None:
        self._allowed = frozenset(_name(host) for host in allowed)
        self._any = "*" in self._allowed

    def check(self, scope: Scope, headers: Mapping[bytes, bytes]) -> None:
        """Refuses a request for somebody else.

        Raises:
          ProblemError: 421.
        """
        given = headers.get(b"host", b"").decode("latin-1")
        name = _name(given)
        if self._any or name in self._allowed or name == _reached_at(scope):
            return
        detail = (
            f"host is {given!r}; wanted one of {', '.join(sorted(self._allowed))}: RISK_SAC_ALLOWED_HOSTS adds to them"
        )
        raise ProblemError(HTTPStatus.MISDIRECTED_REQUEST, Reason.UNKNOWN_HOST, detail)


def _name(host: str) -> str:
    """A host without its port and without the brackets of IPv6: `[::1]:8000` -> `::1`."""
    host = host.lower()
    parts = _HOST.fullmatch(host)
    return host if parts is None else parts["address"] or parts["name"]


def _reached_at(scope: Scope) -> str | None:
    """The address of this end of the connection; a name that points there is not it."""
    server = scope.get("server")
    return None if server is None else server[0].lower().removeprefix("::ffff:")  # IPv4 on a socket for both
