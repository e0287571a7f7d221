"""/v1/campaigns/{id}/failures/{id}/…: what a page shows of a collision, made when it is asked for."""

from collections.abc import Awaitable, Callable
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request, Response
from starlette.concurrency import run_in_threadpool

from risk_sac.failures.export.formats import FORMATS, FormatName, check_carries, names
from risk_sac.failures.question import Twin
from risk_sac.failures.studied import Region
from risk_sac.records import wire
from service.api.answers.problem_body import Reason
from service.api.answers.problems import ProblemError
from service.api.answers.representations import Representation, caching, entity_tag, has, not_modified
from service.api.answers.responses import INVALID, STORAGE, TAGGED, UNKNOWN, Responses, problem
from service.api.context import Context, CurrentCaller, Service
from service.api.routes.exports import CROWDED, LACKING, check_installed
from service.errors import StorageError
from service.views.pictures import ContactOfARun, Picture, Roads, TwinPlay, roads_body, thumbnail_of, twin_body
from service.views.studies import CannotBePlayed, Study

PNG, SVG, JSON, NPZ = "image/png", "image/svg+xml", "application/json", "application/zip"
LOST = problem(404, "Nothing has this id, or its time series is lost")


def _made(media_type: str) -> Responses:
    """Responses of what is made of a collision."""
    return TAGGED | {
        200: TAGGED[200] | {"content": {media_type: {}}},
        **LOST,
        **CROWDED,
    }


PICTURE = _made(PNG)
THUMBNAIL = TAGGED | LOST | {200: TAGGED[200] | {"content": {SVG: {}}}}
PLAYED = problem(409, "The collision does not repeat here, or cannot be played")
_EXPORTED: dict[str, Any] = {FORMATS[name].media_type: {} for name in names("failure")}
EXPORT = _made(NPZ) | PLAYED | LACKING | {200: TAGGED[200] | {"content": _EXPORTED}}
BUNDLE, TWIN, TOLD = _made(NPZ) | PLAYED, _made(PNG) | PLAYED, _made(JSON) | PLAYED

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["campaigns"], responses=STORAGE | INVALID | UNKNOWN)


async def _contact(campaign_id: str, failure_id: str, service: Service, caller: CurrentCaller) -> ContactOfARun:
    campaign = await run_in_threadpool(service.store.campaign, campaign_id, caller.sees)
    stored = await run_in_threadpool(service.store.failure, campaign_id, failure_id, caller.sees)
    return ContactOfARun.of(campaign, stored)


Asked = Annotated[ContactOfARun, Depends(_contact)]


@router.get("/failures/{failure_id}/roads", response_model=Roads, responses=TAGGED)
def get_roads(contact: Asked, request: Request) -> Response:
    """The ground on which a collision came about, as polygons on the map that its time series is on."""
    tag = entity_tag(contact.edition)
    return Representation(roads_body(contact).model_dump_json().encode(), tag, caching(tag)).response(request)


@router.get("/failures/{failure_id}/thumbnail.svg", response_class=Response, responses=THUMBNAIL)
def get_thumbnail(contact: Asked, request: Request, service: Service) -> Response:
    """One collision from above, small: the roads, both paths in the last 3 s, and both bodies as they touch."""
    tag = entity_tag(contact.edition)
    if has(request, tag):
        return not_modified(tag)
    try:
        drawn = thumbnail_of(contact, service.settings)
    except StorageError as error:
        raise _lost(contact, error) from error
    return Response(drawn, headers=caching(tag), media_type=SVG)


@router.get("/failures/{failure_id}/picture.png", response_class=Response, responses=PICTURE)
async def get_picture(contact: Asked, request: Request, service: Service) -> Response:
    """One collision, valid or not: both paths from above, and what was measured along the way."""
    return await _answer(contact, request, PNG, lambda: service.pictures.get(Picture(contact)))


@router.get("/failures/{failure_id}/bundle.npz", response_class=Response, responses=BUNDLE)
async def get_bundle(contact: Asked, request: Request, service: Service) -> Response:
    """One collision in a file that stands alone, once it was played again; `risk-sac replay` plays it anywhere."""
    return await _answer(contact, request, NPZ, lambda: service.studies.get(Study(contact, "bundle")))


@router.get("/failures/{failure_id}/core.npz", response_class=Response, responses=BUNDLE)
async def get_core(contact: Asked, request: Request, service: Service) -> Response:
    """The same with all taken away that the failure does not need; takes up to 150 episodes, some 10 s."""
    return await _answer(contact, request, NPZ, lambda: service.studies.get(Study(contact, "core")))


@router.get("/failures/{failure_id}/export", response_class=Response, responses=EXPORT)
async def get_export(contact: Asked, format: FormatName, request: Request, service: Service) -> Response:
    """One collision in a format of other tools, see `GET /v1/formats`; some are several files, and come as a zip."""
    row = FORMATS[format]
    check_installed(format, "failure")
    check_carries(format, "failure")
    study = Study(contact, "export", format=format)
    answer = await _answer(contact, request, row.media_type, lambda: service.studies.get(study))
    name = f"{contact.episode.id}{f'-{format}' if row.media_type == NPZ else ''}{row.suffix}"
    answer.headers["Content-Disposition"] = f'attachment; filename="{name}"'
    return answer


@router.get("/failures/{failure_id}/region", response_model=Region, responses=TOLD)
async def get_region(contact: Asked, request: Request, service: Service) -> Response:
    """How many of its neighbours fail as it does: nearby scenes, other traffic, other actions; takes 170 episodes."""
    return await _answer(contact, request, JSON, lambda: service.studies.get(Study(contact, "region")))


@router.get("/failures/{failure_id}/twins/{twin}.png", response_class=Response, responses=TWIN)
async def get_twin(contact: Asked, twin: Twin, request: Request, service: Service) -> Response:
    """One collision beside the same scene without an attack (`idle`), or with another ego, on one clock."""

    async def draw() -> bytes:
        return await service.pictures.get(Picture(contact, twin, await _played(contact, twin, service)))

    return await _answer(contact, request, PNG, draw)


@router.get("/failures/{failure_id}/twins/{twin}", response_model=TwinPlay, responses=TOLD)
async def get_twin_play(contact: Asked, twin: Twin, request: Request, service: Service) -> Response:
    """What the same scene comes to without an attack (`idle`), or with another ego, and its full time series."""

    async def tell() -> bytes:
        played = await _played(contact, twin, service)
        return await run_in_threadpool(lambda: wire(twin_body(twin, played)))

    return await _answer(contact, request, JSON, tell)


async def _played(contact: ContactOfARun, twin: Twin, service: Context) -> bytes:
    """A twin as a study tells it, which is played once for its picture and its time series."""
    return await service.studies.get(Study(contact, "twin", twin))


async def _answer(
    contact: ContactOfARun, request: Request, media_type: str, make: Callable[[], Awaitable[bytes]]
) -> Response:
    """A product of a contact, unless the client has it: routes differ in their paths, so the edition is tag enough."""
    tag = entity_tag(contact.edition)
    if has(request, tag):
        return not_modified(tag)
    try:
        content = await make()
    except StorageError as error:
        raise _lost(contact, error) from error
    except CannotBePlayed as error:
        raise ProblemError(HTTPStatus.CONFLICT, Reason.NOT_PLAYABLE, f"{contact.episode.id!r}: {error}") from error
    return Response(content, headers=caching(tag), media_type=media_type)


def _lost(contact: ContactOfARun, error: StorageError) -> ProblemError:
    return ProblemError(HTTPStatus.NOT_FOUND, Reason.SERIES_LOST, f"{contact.episode.id!r} cannot be shown: {error}")
