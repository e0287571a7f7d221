"""/v1/campaigns/{id}/table, figures, clusters, coverage and spec; /v1/coverage; /v1/regressions."""

from collections import Counter
from collections.abc import Callable
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Request, Response
from pydantic import Field
from starlette.concurrency import run_in_threadpool

from risk_sac.config import CampaignSpec, EgoConfig
from risk_sac.config.base import Settings
from risk_sac.config.spec_file import campaign_yaml
from risk_sac.failures.studied import CampaignRegression, Regression
from risk_sac.rates.record import MOST_PER_HOUR
from risk_sac.records import State
from risk_sac.records.assessment import CoverageMatrix
from risk_sac.report.document import CampaignEvidence
from risk_sac.report.figures import FORMATS, Format
from risk_sac.report.files import Table
from risk_sac.report.matrix import merged
from risk_sac.report.rendering import POLICY
from service.api.context import AskedCampaign, Context, CurrentCaller, Service, caller_of
from service.api.pages import (
    INVALID,
    MALFORMED,
    TAGGED,
    UNKNOWN,
    WRONG_TYPE,
    Responses,
    as_json,
    cacheable,
    header,
    link,
    problem,
)
from service.api.posted import documented, read_posted
from service.errors import ConflictError, NotFoundError
from service.runs.regressions import StoredRegression, campaign_of
from service.store.stored import StoredCampaign
from service.views.reports import MEDIA_TYPES, CampaignRates, Clusters, Figures
from service.views.whole import CampaignView, ViewName

TableFormat = Literal["json", "md", "csv"]
SpecFormat = Literal["json", "yaml"]
SPECS: dict[str, Callable[[CampaignSpec], str]] = {"json": CampaignSpec.model_dump_json, "yaml": campaign_yaml}


def text(**examples: str) -> dict[str, Any]:
    """An answer in several formats of text, with an example of each."""
    content = {MEDIA_TYPES[name]: {"schema": {"type": "string"}, "example": text} for name, text in examples.items()}
    return TAGGED[200] | {"content": content}


TABLE: Responses = TAGGED | {
    200: text(
        md="# Comparison of methods\n\n…\n\n## low, search\n\n| method | seeds | ECR | …",
        csv="family,method,phase,runs,episodes,failures,…\nlow,random,search,2,80,3,…",
    )
}
SPEC: Responses = {
    200: {
        "content": {
            MEDIA_TYPES["yaml"]: {
                "schema": {"$ref": "#/components/schemas/CampaignSpec"},
                "example": {"label": "", "families": ["low"]},
            }
        }
    }
}
FIGURE: Responses = TAGGED | {200: TAGGED[200] | {"content": {MEDIA_TYPES[each]: {} for each in FORMATS}}}

MOST_MERGED = 100  # campaigns: each takes up to seconds the first time
coverage_router = APIRouter(prefix="/v1/coverage", tags=["reports"], responses=INVALID)
router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["reports"], responses=INVALID | UNKNOWN)


@router.get("/table", response_model=Table, responses=TABLE)
async def get_table(
    request: Request,
    service: Service,
    campaign: AskedCampaign,
    format_: Annotated[TableFormat, Query(alias="format")] = "json",
) -> Response:
    """Comparison of methods over the finished runs' seeds; names missing runs."""
    address = str(request.base_url)
    return await reported(request, service, campaign, "table", format_, format=format_, address=address)


@router.get("/rates", response_model=CampaignRates, responses=TAGGED)
async def get_rates(
    request: Request,
    service: Service,
    campaign: AskedCampaign,
    exposure: Annotated[
        float | None, Query(ge=0, le=MOST_PER_HOUR, description="Scenes in an hour, for rates per hour.")
    ] = None,
) -> Response:
    """Failure rates under declared distributions, of finished runs of `rate`.

    Each rate is one of its scenario, not of the road. One that fails a check is null, and says why.
    """
    return await reported(request, service, campaign, "rates", "rates", str(exposure), scenes_per_hour=exposure)


@router.get("/clusters", response_model=Clusters, responses=TAGGED)
async def get_clusters(request: Request, service: Service, campaign: AskedCampaign) -> Response:
    """Kinds of failures of the finished runs, with an example of each."""
    return await reported(request, service, campaign, "clusters", "clusters")


@router.get("/coverage", response_model=CoverageMatrix, responses=TAGGED)
async def get_coverage(request: Request, service: Service, campaign: AskedCampaign) -> Response:
    """Coverage by the finished runs: ODD, functional scenarios, requirements, parameters, bodies."""
    return await reported(request, service, campaign, "coverage", "coverage")


@router.get("/figures", response_model=Figures, responses=TAGGED)
async def list_figures(request: Request, service: Service, campaign: AskedCampaign) -> Response:
    """Figures of the finished runs: search, results, λ and α."""
    return await reported(request, service, campaign, "figures", "figures", address=link(request, ""))


@router.get("/figures/{name}.{format}", response_class=Response, responses=FIGURE)
async def get_figure(
    name: str, format: Format, request: Request, service: Service, campaign: AskedCampaign
) -> Response:
    """One figure, drawn on demand and again once more runs have finished."""
    return await reported(request, service, campaign, "drawn", name, format, figure=name, format=format)


@router.get("/spec", response_model=CampaignSpec, responses=SPEC)
def get_spec(campaign: AskedCampaign, format_: Annotated[SpecFormat, Query(alias="format")] = "json") -> Response:
    """Spec of the campaign: JSON to post, or YAML for `--spec`."""
    return Response(SPECS[format_](campaign.spec), media_type=MEDIA_TYPES[format_])


async def reported(
    request: Request,
    service: Context,
    campaign: StoredCampaign,
    view: ViewName,
    *parts: str,
    figure: str | None = None,
    format: str = "json",
    **fields: Any,
) -> Response:
    """Answers with a report's view or figure; `parts` as in `cacheable`."""
    edition = await run_in_threadpool(service.reports.edition, campaign)
    headers = cacheable(request, edition, *parts)
    asked = CampaignView(name=view, campaign_id=campaign.id, edition=edition, format=format, **fields)
    key_id = (await caller_of(request)).key_id
    if figure is None:
        content = await service.views.content(asked, campaign, key_id)
    else:
        content = await service.views.figure(asked, campaign, figure, key_id)
    if not content.lasting:
        del headers["ETag"]
    return Response(content.body, headers=headers, media_type=MEDIA_TYPES[format])


ReportFormat = Literal["json", "html", "md"]
REPORT: Responses = TAGGED | {200: text(html="<!doctype html>…", md="# Failures of an ego: low\n\n> **Search…")}
NOT_PLAYED = problem(409, "The regression has not ended, or has failed")


@router.get("/report", response_model=CampaignEvidence, responses=REPORT | NOT_PLAYED)
async def get_report(
    request: Request,
    service: Service,
    campaign: AskedCampaign,
    format_: Annotated[ReportFormat, Query(alias="format")] = "json",
    regression: Annotated[
        str | None, Query(max_length=200, description="Id of a regression of this campaign, to be told of in it.")
    ] = None,
) -> Response:
    """Evidence of a campaign: test cases, funnel, bounds, coverage and input digests.

    As one page or as Markdown it has pictures, limits and a command for each number, too.
    Search results are no crash rate: bounds come from the i.i.d. phase alone, and there are none without one.
    """
    played = None if regression is None else await run_in_threadpool(_played, service, campaign, regression)
    triages = await run_in_threadpool(service.store.triages, campaign.number)
    people = tuple(sorted(Counter(triages.values()).items()))
    answer = await reported(
        request,
        service,
        campaign,
        "report",
        *("report", format_, *([played.id] if played else []), *(f"{state}{count}" for state, count in people)),
        format=format_,
        address=str(request.base_url),
        regression=Regression(ego=played.ego, cases=played.cases) if played else None,
        people=people,
    )
    if format_ == "html":
        answer.headers["Content-Security-Policy"] = f"{POLICY}; frame-ancestors 'none'"
    return answer


def _played(service: Context, campaign: StoredCampaign, regression_id: str) -> StoredRegression:
    """Returns a regression of the campaign that has succeeded."""
    if campaign_of(regression_id) != campaign.id:
        message = f"campaign {campaign.id} has no regression {regression_id!r}"
        raise NotFoundError(message, field="regression", got=regression_id)
    found = service.regressions.get(regression_id)
    if found.state is not State.SUCCEEDED:
        raise ConflictError(f"regression {found.id} is {found.state}; wanted one that succeeded", reason="not_ended")
    return found


@coverage_router.get("", response_model=CoverageMatrix)
async def get_project_coverage(
    service: Service,
    caller: CurrentCaller,
    ego: Annotated[
        str | None,
        Query(max_length=500, description="Only campaigns of this ego, with its defects: `idm-aeb+latency`."),
    ] = None,
    label: Annotated[
        str | None, Query(max_length=200, pattern=r"^[^\x00]*$", description="Only campaigns with exactly this label.")
    ] = None,
    limit: Annotated[int, Query(ge=1, le=MOST_MERGED, description="Newest campaigns to be merged.")] = MOST_MERGED,
) -> Response:
    """Coverage of a project's newest campaigns; each cell names its campaigns.

    Campaigns of different egos are merged too, unless `ego` picks one: what one ego kept, another need not.
    """
    page = await run_in_threadpool(service.store.campaigns, limit, project=caller.sees, label=label)
    matrices = []
    for campaign in page.items:
        if ego is not None and campaign.spec.ego.name != ego:
            continue
        edition = await run_in_threadpool(service.reports.edition, campaign)
        view = CampaignView(name="coverage", campaign_id=campaign.id, edition=edition)
        content = await service.views.content(view, campaign, caller.key_id)
        matrices.append(CoverageMatrix.model_validate_json(content.body))
    return as_json(merged(matrices))


class PostedRegression(Settings):
    """Campaign and ego of a regression."""

    campaign_id: Annotated[str, Field(max_length=100, pattern=r"^[A-Za-z0-9]+$")]
    """Ended campaign whose distinct failures are played."""
    ego: EgoConfig
    """The other ego, such as `{"profile": "careful"}`."""


POSTING: Responses = (
    {202: {"headers": {"Location": header("Where to follow it.")}}}
    | MALFORMED
    | WRONG_TYPE
    | UNKNOWN
    | problem(409, "The campaign has not ended, or none of its runs has succeeded")
)

regressions_router = APIRouter(prefix="/v1/regressions", tags=["regressions"], responses=INVALID)


async def _posted(request: Request) -> PostedRegression:
    return await read_posted(request, PostedRegression)


@regressions_router.post("", status_code=202, responses=POSTING, openapi_extra=documented("PostedRegression"))
async def post_regression(
    posted: Annotated[PostedRegression, Depends(_posted)],
    request: Request,
    response: Response,
    service: Service,
    caller: CurrentCaller,
) -> CampaignRegression:
    """Play a campaign's distinct failures against another ego; idempotent."""
    campaign = await run_in_threadpool(service.store.campaign, posted.campaign_id, caller.sees)
    regression = await run_in_threadpool(service.regressions.post, campaign, posted.ego, caller.key_id)
    response.headers["Location"] = link(request, f"/v1/regressions/{regression.id}")
    return regression


@regressions_router.get("/{regression_id}", responses=UNKNOWN)
def get_regression(regression_id: str, service: Service, caller: CurrentCaller) -> CampaignRegression:
    """Verdict of each failure: fixed, still failing, new kind, flaky, not comparable."""
    service.store.campaign(campaign_of(regression_id), caller.sees)  # which another project's caller does not see
    return service.regressions.get(regression_id)
