"""/v1/campaigns/{id}/failures/{id}/…: pictures and files of a failure, made on demand."""

from typing import Annotated

from fastapi import APIRouter, Depends, Request, Response
from starlette.concurrency import run_in_threadpool

from risk_sac.failures.question import Twin
from risk_sac.failures.studied import Region
from risk_sac.records import wire
from service.api.answers.representations import cacheable
from service.api.answers.responses import CROWDED, INVALID, STORAGE, TAGGED, UNKNOWN, Responses, problem
from service.api.context import CurrentCaller, Service
from service.views.pictures import FailureOfARun, Picture, Roads, TwinPlay, roads_body, thumbnail_of, twin_body
from service.views.studies import Study

PNG, SVG, JSON, ZIP = "image/png", "image/svg+xml", "application/json", "application/zip"
LOST = problem(404, "Nothing has this id, or its time series is lost")
PLAYED = problem(409, "The failure does not repeat here, or cannot be played")


def made(*media_types: str) -> Responses:
    """Responses of content that is made on demand."""
    return TAGGED | LOST | CROWDED | {200: TAGGED[200] | {"content": {each: {} for each in media_types}}}


router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["campaigns"], responses=STORAGE | INVALID | UNKNOWN)


async def _failure(campaign_id: str, failure_id: str, service: Service, caller: CurrentCaller) -> FailureOfARun:
    campaign = await run_in_threadpool(service.store.campaign, campaign_id, caller.sees)
    stored = await run_in_threadpool(service.store.failure, campaign_id, failure_id, caller.sees)
    return FailureOfARun.of(campaign, stored)


Asked = Annotated[FailureOfARun, Depends(_failure)]


async def _headers(failure: Asked, request: Request) -> dict[str, str]:
    return cacheable(request, failure.edition)  # routes differ in their paths, so the edition is tag enough


Headers = Annotated[dict[str, str], Depends(_headers)]


@router.get("/failures/{failure_id}/roads", response_model=Roads, responses=TAGGED)
def get_roads(failure: Asked, headers: Headers) -> Response:
    """Ground of a failure as polygons, in the coordinates of its time series."""
    return Response(roads_body(failure).model_dump_json(), headers=headers, media_type=JSON)


@router.get(
    "/failures/{failure_id}/thumbnail.svg",
    response_class=Response,
    responses=TAGGED | LOST | {200: made(SVG)[200]},
)
def get_thumbnail(failure: Asked, headers: Headers, service: Service) -> Response:
    """Small picture of a failure from above: roads, paths of the last 3 s, bodies."""
    return Response(thumbnail_of(failure, service.settings), headers=headers, media_type=SVG)


@router.get("/failures/{failure_id}/picture.png", response_class=Response, responses=made(PNG))
async def get_picture(failure: Asked, headers: Headers, service: Service, caller: CurrentCaller) -> Response:
    """Picture of a failure, valid or not: paths from above, and measured series."""
    return Response(await service.pictures.get(Picture(failure), caller.key_id), headers=headers, media_type=PNG)


@router.get("/failures/{failure_id}/bundle.npz", response_class=Response, responses=made(ZIP) | PLAYED)
async def get_bundle(failure: Asked, headers: Headers, service: Service, caller: CurrentCaller) -> Response:
    """Self-contained file of a failure, made after a replay; `risk-sac replay` plays it anywhere."""
    return Response(await service.studies.get(Study(failure, "bundle"), caller.key_id), headers=headers, media_type=ZIP)


@router.get("/failures/{failure_id}/core.npz", response_class=Response, responses=made(ZIP) | PLAYED)
async def get_core(failure: Asked, headers: Headers, service: Service, caller: CurrentCaller) -> Response:
    """The failure reduced to what it needs; takes up to 150 episodes, some 10 s."""
    return Response(await service.studies.get(Study(failure, "core"), caller.key_id), headers=headers, media_type=ZIP)


@router.get("/failures/{failure_id}/region", response_model=Region, responses=made(JSON) | PLAYED)
async def get_region(failure: Asked, headers: Headers, service: Service, caller: CurrentCaller) -> Response:
    """Share of its neighbours that fail alike: nearby scenes, other traffic, other actions; takes 170 episodes."""
    return Response(
        await service.studies.get(Study(failure, "region"), caller.key_id), headers=headers, media_type=JSON
    )


@router.get("/failures/{failure_id}/twins/{twin}.png", response_class=Response, responses=made(PNG) | PLAYED)
async def get_twin(failure: Asked, twin: Twin, headers: Headers, service: Service, caller: CurrentCaller) -> Response:
    """Picture of a failure beside the same scene without an attack (`idle`) or with another ego."""
    played = await service.studies.get(Study(failure, "twin", twin), caller.key_id)
    return Response(
        await service.pictures.get(Picture(failure, twin, played), caller.key_id), headers=headers, media_type=PNG
    )


@router.get("/failures/{failure_id}/twins/{twin}", response_model=TwinPlay, responses=made(JSON) | PLAYED)
async def get_twin_play(
    failure: Asked, twin: Twin, headers: Headers, service: Service, caller: CurrentCaller
) -> Response:
    """Outcome and time series of the same scene without an attack (`idle`) or with another ego."""
    played = await service.studies.get(Study(failure, "twin", twin), caller.key_id)
    body = await run_in_threadpool(lambda: wire(twin_body(twin, played)))
    return Response(body, headers=headers, media_type=JSON)
