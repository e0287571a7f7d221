"""What routes work with; the app puts it in place when it starts."""

from dataclasses import dataclass
from typing import Annotated, cast

from fastapi import Depends, Request
from prometheus_client import CollectorRegistry

from service.api.answers.pages import Cursors
from service.api.stream import Streams
from service.networks.shelf import Shelf
from service.networks.surveys import Surveys
from service.runs.manager import Manager
from service.runs.regressions import Regressions
from service.settings import ServiceSettings
from service.store.reading import Store
from service.views.on_demand import OnDemandCache
from service.views.pictures import Picture
from service.views.reports import Reports
from service.views.studies import Studies
from service.views.tables import Tables


@dataclass(frozen=True, slots=True)
class Context:
    """The running service."""

    settings: ServiceSettings
    store: Store
    manager: Manager
    reports: Reports
    pictures: OnDemandCache[Picture]
    studies: Studies
    tables: Tables
    regressions: Regressions
    networks: Shelf
    surveys: Surveys
    streams: Streams
    cursors: Cursors
    metrics: CollectorRegistry


async def _context(request: Request) -> Context:
    # A coroutine only so that it is not sent to a thread, which costs more than all else of a cheap answer.
    return cast(Context, request.app.state.context)


Service = Annotated[Context, Depends(_context)]
