"""/v1/campaigns/{id}/export: all its episodes in a format of other tools; a failure's own is among `pictures`."""

from typing import Annotated

from fastapi import APIRouter, Depends, Response
from starlette.concurrency import run_in_threadpool

from risk_sac.failures.export.formats import FORMATS, FormatName, check_carries, names
from service.api.access import CurrentCaller
from service.api.answers.made import CROWDED, LACKING, check_installed, crowded
from service.api.answers.responses import INVALID, STORAGE, UNKNOWN, Responses, problem
from service.api.context import Service
from service.errors import ConflictError
from service.store.stored import StoredCampaign
from service.views.on_demand import TooManyWaiting
from service.views.tables import Table

TABLE: Responses = {200: {"content": {FORMATS[name].media_type: {} for name in names("episodes")}}}
NOTHING_YET = problem(409, "No run has played an episode yet")

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["reports"], responses=STORAGE | INVALID | UNKNOWN)


def _campaign(campaign_id: str, service: Service, caller: CurrentCaller) -> StoredCampaign:
    return service.store.campaign(campaign_id, caller.sees)


Asked = Annotated[StoredCampaign, Depends(_campaign)]  # so that who may not see it hears of nothing else


@router.get("/export", response_class=Response, responses=TABLE | NOTHING_YET | LACKING | CROWDED)
async def get_episodes_export(campaign: Asked, format: FormatName, service: Service) -> Response:
    """All episodes so far, whatever their outcome, as a table for other tools, see `GET /v1/formats`."""
    check_installed(format, "episodes")
    check_carries(format, "episodes")
    folders = [service.settings.run_folder(campaign.id, run.id) for run in campaign.runs]
    table = await run_in_threadpool(Table.of, folders, format)
    if not table.folders:
        raise ConflictError(f"no run of campaign {campaign.id} has results yet", reason="not_ended")
    try:
        content = await service.tables.get(table)
    except TooManyWaiting as error:
        raise crowded(error) from error
    row = FORMATS[format]
    name = f'attachment; filename="{campaign.id}{row.suffix}"'
    return Response(content, headers={"Content-Disposition": name}, media_type=row.media_type)
