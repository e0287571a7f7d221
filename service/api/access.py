"""Who calls, and what they may know of: routes take a caller and hand its project to the manager and the store."""

from dataclasses import dataclass
from http import HTTPStatus
from typing import Annotated, cast

from fastapi import Depends, Request

from service.api.answers.problems import ProblemError
from service.keys.key import Scope
from service.schemas.problems import Reason

CALLER = "risk_sac.caller"  # in the ASGI scope, where the gate puts it


@dataclass(frozen=True, slots=True)
class Caller:
    """Somebody whom the gate let in."""

    project: str  # owns what the caller posts
    scope: Scope
    key_id: str | None  # None: a process of this machine, which needs no key

    @property
    def sees(self) -> str | None:
        """The one project whose campaigns the caller may know of; None: all."""
        return None if self.scope is Scope.ADMIN else self.project


LOCAL = Caller("default", Scope.ADMIN, None)


def check_scope(caller: Caller, scope: Scope) -> None:
    """Refuses a caller whose key does not reach so far.

    Raises:
      ProblemError: 403.
    """
    if not caller.scope.includes(scope):
        detail = f"scope of this key is {caller.scope}; wanted {scope}: ask for another key"
        raise ProblemError(HTTPStatus.FORBIDDEN, Reason.FORBIDDEN, detail)


async def _caller(request: Request) -> Caller:
    # Without a default: where the gate is not in place, nobody gets in.
    return cast(Caller, request.scope[CALLER])


CurrentCaller = Annotated[Caller, Depends(_caller)]


async def require_admin(caller: CurrentCaller) -> None:
    """A dependency for routes that want more than the gate does, which is `read` to look and `run` to change."""
    check_scope(caller, Scope.ADMIN)
