"""Dependencies of routes: the running service and the authorised caller."""

from dataclasses import dataclass
from http import HTTPStatus
from typing import Annotated, cast

from fastapi import Depends, Request
from prometheus_client import CollectorRegistry

from service.api.pages import Cursors
from service.api.problems import ProblemError, Reason
from service.api.stream import Streams
from service.keys import Scope
from service.networks.network_store import NetworkStore
from service.networks.scenarios import Scenarios
from service.networks.surveys import Surveys
from service.runs.manager import Manager
from service.runs.regressions import Regressions
from service.settings import ServiceSettings
from service.store.reading import Store
from service.store.stored import StoredCampaign
from service.views.on_demand import OnDemandCache
from service.views.reports import Reports
from service.views.series import EpisodeTables, Picture, Studies
from service.views.whole import Priors, Views


@dataclass(frozen=True, slots=True)
class Context:
    """The running service."""

    settings: ServiceSettings
    store: Store
    manager: Manager
    reports: Reports
    pictures: OnDemandCache[Picture]
    studies: Studies
    tables: EpisodeTables
    views: Views
    priors: Priors
    regressions: Regressions
    networks: NetworkStore
    surveys: Surveys
    scenarios: Scenarios
    scenario_pictures: OnDemandCache[str]
    streams: Streams
    cursors: Cursors
    metrics: CollectorRegistry


async def _context(request: Request) -> Context:
    # A coroutine only so that it is not sent to a thread, which costs more than all else of a cheap answer.
    return cast(Context, request.app.state.context)


Service = Annotated[Context, Depends(_context)]

CALLER = "risk_sac.caller"  # in the ASGI scope, where the gate puts it


@dataclass(frozen=True, slots=True)
class Caller:
    """Authorised caller."""

    project: str  # owns what the caller posts
    scope: Scope
    key_id: str | None  # None: a process of this machine, which needs no key

    @property
    def sees(self) -> str | None:
        """The one project whose campaigns the caller may know of; None: all."""
        return None if self.scope is Scope.ADMIN else self.project


LOCAL = Caller("default", Scope.ADMIN, None)


def check_scope(caller: Caller, scope: Scope) -> None:
    """Refuses a caller whose key does not reach so far."""
    if not caller.scope.includes(scope):
        detail = f"scope of this key is {caller.scope}; wanted {scope}: ask for another key"
        raise ProblemError(HTTPStatus.FORBIDDEN, Reason.FORBIDDEN, detail)


async def caller_of(request: Request) -> Caller:
    """Returns the caller that the gate authorised."""
    # No default: without the gate every call is refused.
    return cast(Caller, request.scope[CALLER])


CurrentCaller = Annotated[Caller, Depends(caller_of)]


def _campaign(campaign_id: str, service: Service, caller: CurrentCaller) -> StoredCampaign:
    return service.store.campaign(campaign_id, caller.sees)


AskedCampaign = Annotated[StoredCampaign, Depends(_campaign)]


async def require_admin(caller: CurrentCaller) -> None:
    """Requires an `admin` key, where the gate requires `read` or `run`."""
    check_scope(caller, Scope.ADMIN)
