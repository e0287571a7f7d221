"""/v1/campaigns/{id}/export: all its episodes in a format of other tools; a failure's own is among `pictures`."""

from http import HTTPStatus
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Response
from starlette.concurrency import run_in_threadpool

from risk_sac.failures.export.formats import FORMATS, REMEDY, FormatName, check_carries, names
from service.api.answers.problem_body import Reason
from service.api.answers.problems import ProblemError
from service.api.answers.responses import INVALID, STORAGE, UNKNOWN, WAIT, Responses, problem
from service.api.context import CurrentCaller, Service
from service.errors import ConflictError
from service.store.stored import StoredCampaign
from service.views.tables import Table

LACKING = problem(501, "The service lacks a package that makes this format")
CROWDED = problem(503, "The database cannot be read, or too many wait for theirs", WAIT)
TABLE: Responses = {200: {"content": {FORMATS[name].media_type: {} for name in names("episodes")}}}
NOTHING_YET = problem(409, "No run has played an episode yet")

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["reports"], responses=STORAGE | INVALID | UNKNOWN)


def check_installed(format: FormatName, of: Literal["failure", "episodes"]) -> None:
    """Answers 501 where the service lacks a package of the format: that is no mistake of the client."""
    row = FORMATS[format]
    if row.of == of and row.missing:
        lacks = f"{format} needs {', '.join(row.missing)}, which is not installed here: {REMEDY}"
        raise ProblemError(HTTPStatus.NOT_IMPLEMENTED, Reason.NOT_INSTALLED, lacks)


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
    content = await service.tables.get(table)
    row = FORMATS[format]
    name = f'attachment; filename="{campaign.id}{row.suffix}"'
    return Response(content, headers={"Content-Disposition": name}, media_type=row.media_type)
