"""What routes work with; the app puts it in place when it starts."""

from dataclasses import dataclass
from typing import Annotated, cast

from fastapi import Depends, Request

from service.manager import Manager
from service.reports import Reports
from service.settings import ServiceSettings
from service.store import Store


@dataclass(frozen=True, slots=True)
class Context:
    """The running service."""

    settings: ServiceSettings
    store: Store
    manager: Manager
    reports: Reports


def _context(request: Request) -> Context:
    return cast(Context, request.app.state.context)


Service = Annotated[Context, Depends(_context)]
