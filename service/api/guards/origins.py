"""The Origin header: a page from elsewhere must not make a browser change anything here."""

from collections.abc import Iterable, Mapping
from http import HTTPStatus

from starlette.types import Scope

from service.api.answers.problems import ProblemError
from service.schemas.problems import Reason

SAFE = frozenset({"GET", "HEAD", "OPTIONS"})  # methods that change nothing


class Origins:
    """Pages that may do more than look: those of the service itself, and those of origins it was told."""

    def __init__(self, allowed: Iterable[str]) -> None:
        self._allowed = frozenset(origin.lower() for origin in allowed)
        self._any = "*" in self._allowed

    def check(self, scope: Scope, headers: Mapping[bytes, bytes]) -> None:
        """Refuses a change that somebody else's page asks for; programs send no Origin.

        Raises:
          ProblemError: 403.
        """
        given = headers.get(b"origin")
        if given is None or self._any or scope["method"] in SAFE:
            return
        origin = given.decode("latin-1").lower()
        # Without the scheme, which a proxy in front may have changed; the host has been checked.
        if origin in self._allowed or origin.partition("://")[2] == headers.get(b"host", b"").decode("latin-1").lower():
            return
        detail = f"origin is {origin!r}; wanted the service's own, or one that RISK_SAC_CORS_ORIGINS names"
        raise ProblemError(HTTPStatus.FORBIDDEN, Reason.FOREIGN_ORIGIN, detail)
