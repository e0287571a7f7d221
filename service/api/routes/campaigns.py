"""/v1/campaigns: post, list, read, cancel, delete."""

from collections.abc import Callable
from hashlib import blake2b
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Query, Request, Response
from fastapi.responses import PlainTextResponse
from pydantic import field_validator
from starlette.concurrency import run_in_threadpool

from risk_sac import __version__
from risk_sac.config import CampaignSpec, FamilyName, MethodName, Settings
from risk_sac.config.campaign import Tag, Tags, check_once
from risk_sac.env.problem import adjustments
from risk_sac.records import Campaign, CampaignCheck, CampaignPage, Power, Record, Results, State, wire
from risk_sac.records.rates import BoundaryMap
from risk_sac.report.grid import PlayedGrid, Standard
from risk_sac.report.statistics import power_of
from risk_sac.run_folder.results import BOUNDARY, BOUNDARY_PICTURE
from risk_sac.search.prior.earlier import PriorContent
from service.api.answer_cache import kept
from service.api.context import Caller, Context, CurrentCaller, Service
from service.api.pages import (
    ACCEPTED,
    INVALID,
    LIVE,
    MALFORMED,
    NOT_ENDED,
    REUSED,
    TAGGED,
    TIERS,
    UNKNOWN,
    WRONG_TYPE,
    Cursor,
    Limit,
    Tier,
    as_json,
    cacheable,
    entity_tag,
    link,
    problem,
)
from service.api.posted import ON_MAP, PostedCampaign, documented, read_posted
from service.errors import ConflictError, NotFoundError
from service.runs.manager import LOG
from service.store.stored import StoredCampaign, StoredRun
from service.views.curves import Curves, SceneEffects, played, results
from service.views.failure_table import FailureTable
from service.views.progress import campaign_body, log_tail, retry_after_s, summary_body
from service.views.reports import MEDIA_TYPES
from service.views.whole import CampaignView, GridFormat, ViewName, run_of

LISTED = "campaigns"
EITHER_KIND = documented(CampaignSpec.__name__, ON_MAP)
POSTING = ACCEPTED | MALFORMED | REUSED | WRONG_TYPE
IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        pattern=r"^[\x21-\x7e]+$",
        description="Posting the same campaign with the same key again gives the campaign that there is.",
    ),
]
Points = Annotated[int, Query(ge=1, le=1000, description="Of each curve, at most.")]

NO_BOUNDARY = problem(409, "The run has not succeeded")
BOUNDARY_PNG = TAGGED | {200: TAGGED[200] | {"content": {"image/png": {}}}}
LOG_TEXT = TAGGED | {200: TAGGED[200] | {"content": {"text/plain": {"schema": {"type": "string"}}}}}

GRID = LIVE | {
    200: LIVE[200]
    | {
        "content": {
            MEDIA_TYPES["csv"]: {"schema": {"type": "string"}, "example": "id,scenario,ego,gap_m,…,verdict\n…"},
            MEDIA_TYPES["xml"]: {"schema": {"type": "string"}},
            MEDIA_TYPES["png"]: {"schema": {"type": "string", "format": "binary"}},
        }
    }
}

router = APIRouter(prefix="/v1/campaigns", tags=["campaigns"], responses=INVALID)


@router.post("", status_code=202, response_model=Campaign, responses=POSTING, openapi_extra=EITHER_KIND)
async def post_campaign(
    request: Request,
    spec: PostedCampaign,
    service: Service,
    caller: CurrentCaller,
    idempotency_key: IdempotencyKey = None,
) -> Response:
    """Queue a campaign: families × methods × seeds on one equal budget."""
    prior = await service.priors.of(spec, caller.project, caller.key_id)
    return await run_in_threadpool(_submit, request, spec, prior, service, caller, idempotency_key)


@router.post("/check", responses=MALFORMED | WRONG_TYPE, openapi_extra=EITHER_KIND)
async def check_campaign(spec: PostedCampaign, service: Service, caller: CurrentCaller) -> CampaignCheck:
    """Validate a campaign without storing it; returns adjusted values and power."""
    checked = await run_in_threadpool(service.manager.checked, spec)
    await service.priors.of(spec, caller.project, caller.key_id)
    return CampaignCheck(adjustments=await run_in_threadpool(adjustments, checked), power=power_of(checked, ()))


@router.get("", response_model=CampaignPage, responses=TAGGED)
def list_campaigns(
    request: Request,
    service: Service,
    caller: CurrentCaller,
    state: Annotated[State | None, Query(description="Only campaigns in this state.")] = None,
    family: Annotated[FamilyName | None, Query(description="Only campaigns with a run of this family.")] = None,
    method: Annotated[MethodName | None, Query(description="Only campaigns with a run of this method.")] = None,
    label: Annotated[
        str | None, Query(max_length=200, pattern=r"^[^\x00]*$", description="Only campaigns with exactly this label.")
    ] = None,
    tag: Annotated[Tag | None, Query(description="Only campaigns with this tag.")] = None,
    search: Annotated[
        str | None,
        Query(
            max_length=200,
            pattern=r"^[^\x00]*$",
            description="Only campaigns whose label or id contains each of these words, in any case.",
        ),
    ] = None,
    limit: Limit = 50,
    cursor: Cursor = None,
) -> Response:
    """Campaigns, newest first; new ones appear before the first page."""
    revision = service.store.revision_of_all()
    page = service.store.campaigns(
        limit,
        service.cursors.decode(cursor, LISTED, caller.sees),
        project=caller.sees,
        state=state,
        family=family,
        method=method,
        label=label,
        tag=tag,
        search=search,
    )
    items = [summary_body(campaign, service.manager.workers) for campaign in page.items]
    cursor = service.cursors.encode(page.last, LISTED, caller.sees)
    body = wire(CampaignPage(items=items, next=cursor))
    headers = {"Cache-Control": "no-cache", "ETag": entity_tag(_digest(body))}
    return kept(request, body, headers, revision)


@router.post("/{campaign_id}/cancel", status_code=202, response_model=Campaign, responses=UNKNOWN | ACCEPTED)
def cancel_campaign(campaign_id: str, request: Request, service: Service, caller: CurrentCaller) -> Response:
    """Stop a campaign and keep its results; no effect after its end."""
    campaign = service.manager.cancel(campaign_id, caller.sees)
    return _accepted(request, campaign, service)


class PostedTags(Settings):
    """Tags that a campaign gets in place of its present ones."""

    tags: Tags

    @field_validator("tags")
    @classmethod
    def _once(cls, tags: Tags) -> Tags:
        check_once("", tags)
        return tags


async def _posted_tags(request: Request) -> PostedTags:
    return await read_posted(request, PostedTags)


@router.put(
    "/{campaign_id}/tags",
    response_model=Campaign,
    responses=UNKNOWN | MALFORMED | WRONG_TYPE,
    openapi_extra=documented(PostedTags.__name__),
)
def put_tags(
    campaign_id: str, posted: Annotated[PostedTags, Depends(_posted_tags)], service: Service, caller: CurrentCaller
) -> Response:
    """Replace the tags of a campaign."""
    campaign = service.manager.tag(campaign_id, posted.tags, caller.sees)
    return as_json(_body(campaign, service))


@router.delete("/{campaign_id}", status_code=204, responses=UNKNOWN | NOT_ENDED)
def delete_campaign(campaign_id: str, service: Service, caller: CurrentCaller) -> None:
    """Delete an ended campaign with its results and files."""
    service.manager.delete(campaign_id, caller.sees)


@router.get("/{campaign_id}", response_model=Campaign, responses=UNKNOWN | LIVE)
def get_campaign(campaign_id: str, request: Request, service: Service, caller: CurrentCaller) -> Response:
    """State, progress and runs of a campaign."""
    return _live(campaign_id, request, service, caller, lambda found: _body(found, service))


@router.get("/{campaign_id}/results", response_model=Results, responses=UNKNOWN | LIVE)
def get_results(campaign_id: str, request: Request, service: Service, caller: CurrentCaller) -> Response:
    """Results of a campaign; partial until it has ended."""
    return _live(campaign_id, request, service, caller, results)


@router.get("/{campaign_id}/power", response_model=Power, responses=UNKNOWN | LIVE)
def get_power(campaign_id: str, request: Request, service: Service, caller: CurrentCaller) -> Response:
    """Number of known defects that this budget detects, from a stored benchmark."""
    return _live(campaign_id, request, service, caller, lambda found: power_of(found.spec, played(found)))


@router.get("/{campaign_id}/failure-table", response_model=FailureTable, responses=UNKNOWN | LIVE)
async def get_failure_table(
    campaign_id: str, request: Request, service: Service, caller: CurrentCaller, tier: Tier = "valid"
) -> Response:
    """All failures at once, by columns, to sort, filter and plot them."""
    return await _viewed(campaign_id, request, service, caller, name="failure_table", outcomes=TIERS[tier])


@router.get("/{campaign_id}/curves", response_model=Curves, responses=UNKNOWN | LIVE)
async def get_curves(
    campaign_id: str, request: Request, service: Service, caller: CurrentCaller, points: Points = 200
) -> Response:
    """Curves of each run over its episodes: rates, distinct failures, λ, cost."""
    return await _viewed(campaign_id, request, service, caller, name="curves", points=points)


@router.get("/{campaign_id}/scenes", response_model=SceneEffects, responses=UNKNOWN | LIVE)
async def get_scenes(campaign_id: str, request: Request, service: Service, caller: CurrentCaller) -> Response:
    """Scene parameters that set failing episodes apart, and ODD parts played."""
    return await _viewed(campaign_id, request, service, caller, name="scenes")


@router.get("/{campaign_id}/runs/{run_id}/grid", response_model=PlayedGrid, responses=UNKNOWN | GRID)
async def get_grid(
    campaign_id: str,
    run_id: str,
    request: Request,
    service: Service,
    caller: CurrentCaller,
    format_: Annotated[
        GridFormat, Query(alias="format", description="`xml` is a JUnit report, `png` a picture over two parameters.")
    ] = "json",
    standard: Annotated[
        Standard,
        Query(description="Whose avoidance makes a contact the ego's failure: R157's driver, the FSM, or either."),
    ] = "r157",
    over: Annotated[
        tuple[str, ...],
        Query(max_length=2, description="The two parameters of the picture; without them the first two that vary."),
    ] = (),
) -> Response:
    """Verdicts on each scene of a `story-sweep`, `story-random` or `story-bo` run."""
    fields = {"run": run_id, "format": format_, "standard": standard, "over": over}
    return await _viewed(campaign_id, request, service, caller, name="grid", media_type=MEDIA_TYPES[format_], **fields)


@router.get("/{campaign_id}/runs/{run_id}/log", response_class=Response, responses=UNKNOWN | LOG_TEXT)
def get_log(
    campaign_id: str,
    run_id: str,
    request: Request,
    service: Service,
    caller: CurrentCaller,
    lines: Annotated[int, Query(ge=1, le=1000, description="At most; fewer where they are long.")] = 200,
) -> Response:
    """Last lines that a run's workers printed, without the server's folders."""
    run_of(service.store.campaign(campaign_id, caller.sees), run_id)
    text = log_tail(service.settings.run_folder(campaign_id, run_id) / LOG, lines).encode()
    return PlainTextResponse(text, headers=cacheable(request, _digest(text)))


@router.get(
    "/{campaign_id}/runs/{run_id}/boundary", response_model=BoundaryMap, responses=UNKNOWN | TAGGED | NO_BOUNDARY
)
def get_boundary(campaign_id: str, run_id: str, request: Request, service: Service, caller: CurrentCaller) -> Response:
    """Boundary between passing and failing that a run of `boundary` found."""
    content = _boundary(run_of(service.store.campaign(campaign_id, caller.sees), run_id), BOUNDARY, service)
    return Response(content, headers=cacheable(request, _digest(content)), media_type="application/json")


@router.get(
    "/{campaign_id}/runs/{run_id}/boundary.png",
    response_class=Response,
    responses=UNKNOWN | BOUNDARY_PNG | NO_BOUNDARY,
)
def get_boundary_picture(
    campaign_id: str, run_id: str, request: Request, service: Service, caller: CurrentCaller
) -> Response:
    """The same boundary as a picture over the first two parameters."""
    content = _boundary(run_of(service.store.campaign(campaign_id, caller.sees), run_id), BOUNDARY_PICTURE, service)
    return Response(content, headers=cacheable(request, _digest(content)), media_type="image/png")


def _boundary(run: StoredRun, file: str, service: Context) -> bytes:
    """Reads what the worker wrote at the run's end.

    Raises:
      NotFoundError: the run is of another method.
      ConflictError: it has not succeeded, or its file is gone.
    """
    if run.method != "boundary":
        message = f"run {run.id} is of the method {run.method}; wanted one of boundary"
        raise NotFoundError(message, field="run_id", got=run.id)
    try:
        return (service.settings.run_folder(run.campaign_id, run.id) / file).read_bytes()
    except FileNotFoundError as error:
        raise ConflictError(f"run {run.id} is {run.state} and has no boundary", reason="not_ended") from error


def _submit(
    request: Request,
    spec: CampaignSpec,
    prior: PriorContent | None,
    service: Context,
    caller: Caller,
    idempotency_key: str | None,
) -> Response:
    campaign = service.manager.submit(
        spec, project=caller.project, key=idempotency_key, prior=prior, base_url=str(request.base_url)
    )
    return _accepted(request, campaign, service)


def _body(campaign: StoredCampaign, service: Context) -> Campaign:
    """A campaign in full, with the message to its end."""
    notice = service.store.notice(campaign.number) if campaign.spec.on_end else None
    return campaign_body(campaign, service.manager.workers).model_copy(update={"notice": notice})


def _live(
    campaign_id: str, request: Request, service: Context, caller: Caller, body: Callable[[StoredCampaign], Record]
) -> Response:
    """An answer about one campaign, which the cache keeps."""
    campaign, headers, revision = _current(campaign_id, request, service, caller)
    return kept(request, wire(body(campaign)), headers, revision, campaign_id)


async def _viewed(
    campaign_id: str,
    request: Request,
    service: Context,
    caller: Caller,
    *,
    name: ViewName,
    media_type: str = MEDIA_TYPES["json"],
    **fields: Any,
) -> Response:
    """Answers with a cached view that reads all episodes of a campaign."""
    campaign, headers, revision = await run_in_threadpool(_current, campaign_id, request, service, caller)
    view = CampaignView(name=name, campaign_id=campaign_id, edition=campaign.revision, **fields)
    content = await service.views.content(view, campaign, caller.key_id)
    return kept(request, content.body, headers, revision, campaign_id, media_type=media_type)


def _current(
    campaign_id: str, request: Request, service: Context, caller: Caller
) -> tuple[StoredCampaign, dict[str, str], str]:
    """Returns the campaign, the answer's headers, and the revision read before it."""
    revision = service.store.revision(campaign_id, caller.sees)
    campaign = service.store.campaign(campaign_id, caller.sees)
    # The revision that was read, which may be newer. A body depends on it, on the version and on how many are at work.
    parts = (campaign.revision, __version__, str(service.manager.workers))
    return campaign, cacheable(request, *parts, others=_retry_after(campaign, service)), revision


def _digest(content: bytes) -> str:
    return blake2b(content, digest_size=8).hexdigest()


def _accepted(request: Request, campaign: StoredCampaign, service: Context) -> Response:
    headers = {"Location": link(request, f"/v1/campaigns/{campaign.id}")} | _retry_after(campaign, service)
    body = wire(_body(campaign, service))
    return Response(body, status_code=202, headers=headers, media_type="application/json")


def _retry_after(campaign: StoredCampaign, service: Context) -> dict[str, str]:
    """Returns the Retry-After header; none once the campaign has ended."""
    wait_s = retry_after_s(campaign, service.manager.workers)
    return {} if wait_s is None else {"Retry-After": str(wait_s)}
