"""/v1/campaigns/{id}/export: all its episodes in a format of other tools; a failure's own is among `pictures`.

A sync route, so that it is made in FastAPI's thread pool.
"""

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Depends, Response

from risk_sac.failures.export.formats import FORMATS, FormatName, check_carries, names
from risk_sac.run_folder.results import RESULTS
from service.api.access import CurrentCaller
from service.api.answers.problems import ProblemError
from service.api.answers.responses import INVALID, STORAGE, UNKNOWN, Responses, problem
from service.api.context import Service
from service.api.routes.pictures import LACKING, RETRY_AFTER_S, check_installed
from service.errors import ConflictError
from service.schemas.problems import Reason
from service.store.stored import StoredCampaign
from service.views.products import TooManyWaiting
from service.views.tables import table_of

TABLE: Responses = {200: {"content": {FORMATS[name].media_type: {} for name in names("episodes")}}}
NOTHING_YET = problem(409, "No run has played an episode yet")

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["reports"], responses=STORAGE | INVALID | UNKNOWN)


def _campaign(campaign_id: str, service: Service, caller: CurrentCaller) -> StoredCampaign:
    return service.store.campaign(campaign_id, caller.sees)


Asked = Annotated[StoredCampaign, Depends(_campaign)]  # so that who may not see it hears of nothing else


@router.get("/export", response_class=Response, responses=TABLE | NOTHING_YET | LACKING)
def get_episodes_export(campaign: Asked, format: FormatName, service: Service) -> Response:
    """All episodes so far, whatever their outcome, as a table for other tools, see `GET /v1/formats`."""
    check_installed(format, "episodes")
    check_carries(format, "episodes")
    folders = [service.settings.run_folder(campaign.id, run.id) for run in campaign.runs]
    begun = [folder for folder in folders if (folder / RESULTS).exists()]
    if not begun:
        raise ConflictError(f"no run of campaign {campaign.id} has results yet", reason="not_ended")
    try:
        content = table_of(begun, format)
    except TooManyWaiting as error:
        wait = {"Retry-After": str(RETRY_AFTER_S)}
        raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.PICTURES_BUSY, str(error), headers=wait) from error
    row = FORMATS[format]
    name = f'attachment; filename="{campaign.id}{row.suffix}"'
    return Response(content, headers={"Content-Disposition": name}, media_type=row.media_type)
