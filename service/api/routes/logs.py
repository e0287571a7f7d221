"""/v1/campaigns/{id}/runs/{id}/log: what a run's worker printed, to see why it failed or what it is about.

A sync route, so that the file is read in FastAPI's thread pool.
"""

from hashlib import blake2b
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import PlainTextResponse

from service.api.access import CurrentCaller
from service.api.answers.representations import caching, entity_tag, has, not_modified
from service.api.answers.responses import INVALID, STORAGE, TAGGED, UNKNOWN
from service.api.context import Service
from service.errors import NotFoundError
from service.runs.manager import LOG
from service.views.logs import log_tail

MOST_LINES = 1000
TEXT = TAGGED | {200: TAGGED[200] | {"content": {"text/plain": {"schema": {"type": "string"}}}}}

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["campaigns"], responses=STORAGE | INVALID | UNKNOWN)


@router.get("/runs/{run_id}/log", response_class=Response, responses=TEXT)
def get_log(
    campaign_id: str,
    run_id: str,
    request: Request,
    service: Service,
    caller: CurrentCaller,
    lines: Annotated[int, Query(ge=1, le=MOST_LINES, description="At most; fewer where they are long.")] = 200,
) -> Response:
    """The last lines that the workers of a run printed, without the server's folders; empty before there are any."""
    campaign = service.store.campaign(campaign_id, caller.sees)
    if run_id not in {run.id for run in campaign.runs}:
        message = f"campaign {campaign_id} has no run {run_id!r}; GET it lists all runs"
        raise NotFoundError(message, field="run_id", got=run_id)
    text = log_tail(service.settings.run_folder(campaign_id, run_id) / LOG, lines).encode()
    tag = entity_tag(blake2b(text, digest_size=8).hexdigest())
    return not_modified(tag) if has(request, tag) else PlainTextResponse(text, headers=caching(tag))
