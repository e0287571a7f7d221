"""/v1/campaigns/{id} and its results: what is polled, and so costs as little as a route can."""

from collections.abc import Awaitable, Callable
from typing import cast

from fastapi import APIRouter, Request, Response
from fastapi.routing import APIRoute

from service.api.access import CALLER, Caller
from service.api.answers.responses import INVALID, LIVE, STORAGE, UNKNOWN
from service.api.context import Context
from service.api.live import Rendered
from service.api.recall import remember
from service.schemas import Campaign, Results


class DirectRoute(APIRoute):
    """A route that is documented like all others, but calls its endpoint with the path's parameters and the request.

    FastAPI's search for dependencies, of which there must be none, would be two thirds of the cost of an answer that
    was given before.
    """

    def get_route_handler(self) -> Callable[[Request], Awaitable[Response]]:  # type: ignore[override]
        """FastAPI's hook for routes of another kind."""
        endpoint = cast(Callable[..., Awaitable[Response]], self.endpoint)

        async def handle(request: Request) -> Response:
            return await endpoint(**request.path_params, request=request)

        return handle


router = APIRouter(
    prefix="/v1/campaigns/{campaign_id}",
    tags=["campaigns"],
    responses=STORAGE | INVALID | UNKNOWN | LIVE,
    route_class=DirectRoute,
)


@router.get("", response_model=Campaign)
async def get_campaign(campaign_id: str, request: Request) -> Response:
    """State, progress and runs of a campaign."""
    return await _answer(campaign_id, request, _context(request).live.campaign)


@router.get("/results", response_model=Results)
async def get_results(campaign_id: str, request: Request) -> Response:
    """What a campaign has found; partial until it has ended."""
    return await _answer(campaign_id, request, _context(request).live.results)


async def _answer(campaign_id: str, request: Request, render: Callable[..., Awaitable[Rendered]]) -> Response:
    mark = _context(request).store.mark(campaign_id)
    rendered = await render(campaign_id, cast(Caller, request.scope[CALLER]).sees)
    if mark is not None and rendered.revision == str(mark.latest):  # else it is older, or newer
        remember(request, rendered, mark, campaign_id)
    return rendered.response(request)


def _context(request: Request) -> Context:
    return cast(Context, request.app.state.context)
