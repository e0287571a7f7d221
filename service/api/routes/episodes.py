"""/v1/campaigns/{id}/episodes and failures."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response
from pydantic import Field
from starlette.concurrency import run_in_threadpool

from risk_sac.config.base import Settings
from risk_sac.failures.net import RoadsBody
from risk_sac.failures.question import Twin
from risk_sac.failures.studied import Region
from risk_sac.records import (
    DrivenBy,
    Episode,
    EpisodePage,
    Failure,
    FailureOrder,
    Fault,
    Grade,
    Outcome,
    PlausibilityClass,
    Severity,
    Triage,
    TriageState,
    wire,
)
from service.api.context import CurrentCaller, Service
from service.api.pages import (
    INVALID,
    MALFORMED,
    TAGGED,
    TIERS,
    UNKNOWN,
    WRONG_TYPE,
    Cursor,
    Limit,
    Responses,
    Tier,
    as_json,
    cacheable,
    problem,
)
from service.api.posted import AskedRequirement, documented, read_posted
from service.store.queries import Judged
from service.store.stored import StoredPage
from service.views.series import (
    FailureOfARun,
    Picture,
    Study,
    TwinBody,
    failure_body,
    roads_body,
    thumbnail_of,
    twin_body,
)

# Text of any language, with tabs and new lines; other control characters could hide or reorder what is shown.
TEXT = r"^[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$"

AskedDrivenBy = Annotated[DrivenBy | None, Query(description="Only those whose adversaries this drove.")]


class PostedTriage(Settings):
    """Triage to store for a failure."""

    state: TriageState
    """new: undecided; confirmed: the ego has to be fixed; dismissed: it has not; fixed: it has been."""
    comment: Annotated[str, Field(max_length=2000, pattern=TEXT)] = ""
    """Reason, as plain text."""


router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["campaigns"], responses=INVALID | UNKNOWN)


async def _posted_triage(request: Request) -> PostedTriage:
    return await read_posted(request, PostedTriage)


@router.get("/episodes", response_model=EpisodePage)
def list_episodes(
    campaign_id: str,
    service: Service,
    caller: CurrentCaller,
    run: Annotated[str | None, Query(description="Only episodes of this run.")] = None,
    outcome: Annotated[Outcome | None, Query(description="Only episodes that ended so.")] = None,
    driven_by: AskedDrivenBy = None,
    requirement: AskedRequirement = None,
    limit: Limit = 50,
    cursor: Cursor = None,
) -> Response:
    """Episodes of a campaign in order of arrival."""
    page = service.store.episodes(
        campaign_id,
        limit=limit,
        after=service.cursors.decode(cursor, campaign_id, caller.sees),
        run_id=run,
        outcomes=() if outcome is None else (outcome,),
        judged=Judged(requirement=requirement, driven_by=driven_by),
        project=caller.sees,
    )
    return _page(page, service.cursors.encode(page.last, campaign_id, caller.sees))


@router.get("/failures", response_model=EpisodePage)
def list_failures(
    campaign_id: str,
    service: Service,
    caller: CurrentCaller,
    tier: Tier = "valid",
    run: Annotated[
        str | None, Query(description="Only failures of this run. Without it, none of an i.i.d. phase.")
    ] = None,
    requirement: AskedRequirement = None,
    grade: Annotated[Grade | None, Query(description="Only failures of this grade.")] = None,
    plausibility: Annotated[
        PlausibilityClass | None, Query(description="Only those whose adversaries are as plausible as this.")
    ] = None,
    severity: Annotated[Severity | None, Query(description="Only contacts as bad as this.")] = None,
    fault: Annotated[Fault | None, Query(description="Only those that this party caused.")] = None,
    driven_by: AskedDrivenBy = None,
    broke: Annotated[
        str | None, Query(max_length=40, pattern="^[a-z_]+$", description="Only those whose striker broke this.")
    ] = None,
    kind: Annotated[
        str | None, Query(max_length=300, pattern=r"^[^\x00]*$", description="Only those of exactly this kind.")
    ] = None,
    order: Annotated[
        FailureOrder, Query(description="weight: the most likely and severe first, by severity × plausibility.")
    ] = "arrival",
    limit: Limit = 50,
    cursor: Cursor = None,
) -> Response:
    """Failures of a campaign: violations of requirements that count, contacts included."""
    listed = campaign_id if order == "arrival" else f"{campaign_id} by {order}"
    page = service.store.episodes(
        campaign_id,
        limit=limit,
        after=service.cursors.decode(cursor, listed, caller.sees),
        run_id=run,
        outcomes=TIERS[tier],
        judged=Judged(
            requirement=requirement,
            valid=tier == "valid",
            grade=grade,
            plausibility=plausibility,
            severity=severity,
            fault=fault,
            driven_by=driven_by,
            broke=broke,
            kind=kind,
            iid=run is not None,
        ),
        weighty=order == "weight",
        project=caller.sees,
    )
    return _page(page, service.cursors.encode(page.last, listed, caller.sees))


@router.get("/failures/{failure_id}", response_model=Failure)
def get_failure(campaign_id: str, failure_id: str, service: Service, caller: CurrentCaller) -> Response:
    """One failure, valid or not, with its full time series."""
    failure = service.store.failure(campaign_id, failure_id, caller.sees)
    triage = service.store.triage(campaign_id, failure_id, caller.sees)
    return as_json(failure_body(campaign_id, failure, triage, service.settings))


@router.put("/failures/{failure_id}/triage", responses=MALFORMED | WRONG_TYPE, openapi_extra=documented("PostedTriage"))
def put_triage(
    campaign_id: str,
    failure_id: str,
    posted: Annotated[PostedTriage, Depends(_posted_triage)],
    service: Service,
    caller: CurrentCaller,
) -> Triage:
    """Store a failure's triage, replacing an earlier one; deleted with the campaign."""
    return service.manager.triage(campaign_id, failure_id, posted.state, posted.comment, caller.sees)


def _page(page: StoredPage[Episode], cursor: str | None) -> Response:
    return as_json(EpisodePage(items=list(page.items), next=cursor))


PNG, SVG, JSON, ZIP = "image/png", "image/svg+xml", "application/json", "application/zip"
LOST = problem(404, "Nothing has this id, or its time series is lost")
PLAYED = problem(409, "The failure does not repeat here, or cannot be played")


def made(*media_types: str) -> Responses:
    """Responses of content that is made on demand."""
    return TAGGED | LOST | {200: TAGGED[200] | {"content": {each: {} for each in media_types}}}


async def _failure(campaign_id: str, failure_id: str, service: Service, caller: CurrentCaller) -> FailureOfARun:
    campaign = await run_in_threadpool(service.store.campaign, campaign_id, caller.sees)
    stored = await run_in_threadpool(service.store.failure, campaign_id, failure_id, caller.sees)
    return FailureOfARun.of(campaign, stored)


Asked = Annotated[FailureOfARun, Depends(_failure)]


async def _headers(failure: Asked, request: Request) -> dict[str, str]:
    return cacheable(request, failure.edition)  # routes differ in their paths, so the edition is tag enough


Headers = Annotated[dict[str, str], Depends(_headers)]


@router.get("/failures/{failure_id}/roads", response_model=RoadsBody, responses=TAGGED)
def get_roads(failure: Asked, headers: Headers) -> Response:
    """Ground of a failure as polygons, in its time series' coordinates."""
    return Response(roads_body(failure).model_dump_json(), headers=headers, media_type=JSON)


@router.get(
    "/failures/{failure_id}/thumbnail.svg",
    response_class=Response,
    responses=TAGGED | LOST | {200: made(SVG)[200]},
)
def get_thumbnail(failure: Asked, headers: Headers, service: Service) -> Response:
    """Small picture of a failure from above, with its last 3 s."""
    return Response(thumbnail_of(failure, service.settings), headers=headers, media_type=SVG)


@router.get("/failures/{failure_id}/picture.png", response_class=Response, responses=made(PNG))
async def get_picture(failure: Asked, headers: Headers, service: Service, caller: CurrentCaller) -> Response:
    """Picture of a failure, valid or not: paths and measured series."""
    return Response(await service.pictures.get(Picture(failure), caller.key_id), headers=headers, media_type=PNG)


@router.get("/failures/{failure_id}/bundle.npz", response_class=Response, responses=made(ZIP) | PLAYED)
async def get_bundle(failure: Asked, headers: Headers, service: Service, caller: CurrentCaller) -> Response:
    """File of a failure that `risk-sac replay` plays anywhere; made after replaying."""
    return Response(await service.studies.get(Study(failure, "bundle"), caller.key_id), headers=headers, media_type=ZIP)


@router.get("/failures/{failure_id}/core.npz", response_class=Response, responses=made(ZIP) | PLAYED)
async def get_core(failure: Asked, headers: Headers, service: Service, caller: CurrentCaller) -> Response:
    """Failure reduced to what it needs; up to 150 episodes (10 s)."""
    return Response(await service.studies.get(Study(failure, "core"), caller.key_id), headers=headers, media_type=ZIP)


@router.get("/failures/{failure_id}/most-plausible.npz", response_class=Response, responses=made(ZIP) | PLAYED)
async def get_most_plausible(failure: Asked, headers: Headers, service: Service, caller: CurrentCaller) -> Response:
    """Recording and least unlikely failing motion; up to 300 episodes (20 s)."""
    study = Study(failure, "most-plausible")
    return Response(await service.studies.get(study, caller.key_id), headers=headers, media_type=ZIP)


@router.get("/failures/{failure_id}/region", response_model=Region, responses=made(JSON) | PLAYED)
async def get_region(failure: Asked, headers: Headers, service: Service, caller: CurrentCaller) -> Response:
    """Share of neighbours (scenes, traffic, actions) that fail alike; takes 170 episodes."""
    return Response(
        await service.studies.get(Study(failure, "region"), caller.key_id), headers=headers, media_type=JSON
    )


@router.get("/failures/{failure_id}/twins/{twin}.png", response_class=Response, responses=made(PNG) | PLAYED)
async def get_twin(failure: Asked, twin: Twin, headers: Headers, service: Service, caller: CurrentCaller) -> Response:
    """Picture of a failure beside its twin: unattacked (`idle`) or another ego."""
    played = await service.studies.get(Study(failure, "twin", twin), caller.key_id)
    return Response(
        await service.pictures.get(Picture(failure, twin, played), caller.key_id), headers=headers, media_type=PNG
    )


@router.get("/failures/{failure_id}/twins/{twin}", response_model=TwinBody, responses=made(JSON) | PLAYED)
async def get_twin_play(
    failure: Asked, twin: Twin, headers: Headers, service: Service, caller: CurrentCaller
) -> Response:
    """Outcome and series of a twin: unattacked (`idle`) or with another ego."""
    played = await service.studies.get(Study(failure, "twin", twin), caller.key_id)
    body = await run_in_threadpool(lambda: wire(twin_body(twin, played)))
    return Response(body, headers=headers, media_type=JSON)
