"""/v1/campaigns/{id}/export and failures/{id}/export: episodes or one failure for other tools."""

from functools import partial
from http import HTTPStatus
from typing import Annotated, Literal

from fastapi import APIRouter, Response
from pydantic import BeforeValidator, WithJsonSchema
from starlette.concurrency import run_in_threadpool

from risk_sac.errors import ConfigError
from risk_sac.failures.export.formats import FORMATS, REMEDY, ZIP, FormatName, names
from service.api.context import AskedCampaign, CurrentCaller, Service
from service.api.pages import INVALID, UNKNOWN, problem
from service.api.problems import ProblemError, Reason
from service.api.routes.episodes import PLAYED, Asked, Headers, made
from service.errors import ConflictError
from service.views.series import EpisodeTable, Study

LACKING = problem(501, "The service lacks a package that makes this format")
NOTHING_YET = problem(409, "No run has played an episode yet")

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", responses=INVALID | UNKNOWN)


def _checked(given: str, of: Literal["failure", "episodes"]) -> FormatName:
    if given not in names(of):
        raise ConfigError("", repr(given), f"one of: {', '.join(names(of))}")
    name = FormatName(given)
    if missing := FORMATS[name].missing:  # no mistake of the client
        lacks = f"{name} needs {', '.join(missing)}, which is not installed here: {REMEDY}"
        raise ProblemError(HTTPStatus.NOT_IMPLEMENTED, Reason.NOT_INSTALLED, lacks)
    return name


FailureFormat = Annotated[
    FormatName,
    BeforeValidator(partial(_checked, of="failure")),
    WithJsonSchema({"type": "string", "enum": names("failure")}),
]
EpisodesFormat = Annotated[
    FormatName,
    BeforeValidator(partial(_checked, of="episodes")),
    WithJsonSchema({"type": "string", "enum": names("episodes")}),
]


@router.get(
    "/failures/{failure_id}/export",
    tags=["campaigns"],
    response_class=Response,
    responses=made(*(FORMATS[name].media_type for name in names("failure"))) | PLAYED | LACKING,
)
async def get_export(
    failure: Asked, format: FailureFormat, headers: Headers, service: Service, caller: CurrentCaller
) -> Response:
    """One failure in a format of `GET /v1/formats`; several files as zip."""
    content = await service.studies.get(Study(failure, "export", format=format), caller.key_id)
    row = FORMATS[format]
    name = f"{failure.episode.id}-{failure.edition[:8]}{f'-{format}' if row.media_type == ZIP else ''}{row.suffix}"
    return Response(content, headers=headers | _attachment(name), media_type=row.media_type)


@router.get(
    "/export",
    tags=["reports"],
    response_class=Response,
    responses={200: {"content": {FORMATS[name].media_type: {} for name in names("episodes")}}} | NOTHING_YET | LACKING,
)
async def get_episodes_export(
    campaign: AskedCampaign, format: EpisodesFormat, service: Service, caller: CurrentCaller
) -> Response:
    """All episodes so far as a table, in a format of `/v1/formats`."""
    folders = [service.settings.run_folder(campaign.id, run.id) for run in campaign.runs]
    table = await run_in_threadpool(EpisodeTable.of, folders, format)
    if not table.folders:
        raise ConflictError(f"no run of campaign {campaign.id} has results yet", reason="not_ended")
    content = await service.tables.get(table, caller.key_id)
    row = FORMATS[format]
    return Response(content, headers=_attachment(f"{campaign.id}{row.suffix}"), media_type=row.media_type)


def _attachment(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"'}
