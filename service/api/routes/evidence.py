"""/v1/campaigns/{id}/report: failures, bounds of the i.i.d. phase, and coverage."""

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response
from starlette.concurrency import run_in_threadpool

from risk_sac.failures.cases import Regression
from risk_sac.records import State
from risk_sac.report.evidence import CampaignEvidence
from risk_sac.report.rendering import POLICY
from service.api.context import AskedCampaign, Context, Service
from service.api.pages import CROWDED, INVALID, STORAGE, UNKNOWN, Responses, problem
from service.api.routes.reports import UNCHANGED, reported, text
from service.errors import ConflictError, NotFoundError
from service.runs.regressions import StoredRegression, campaign_of
from service.store.stored import StoredCampaign

ReportFormat = Literal["json", "html", "md"]
REPORT: Responses = {200: text(html="<!doctype html>…", md="# Failures of an ego: low\n\n> **Search…")}
NOT_PLAYED = problem(409, "The regression has not ended, or has failed")

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["reports"], responses=STORAGE | INVALID | UNKNOWN)


@router.get("/report", response_model=CampaignEvidence, responses=REPORT | UNCHANGED | NOT_PLAYED | CROWDED)
async def get_report(
    request: Request,
    service: Service,
    campaign: AskedCampaign,
    format_: Annotated[ReportFormat, Query(alias="format")] = "json",
    regression: Annotated[
        str | None, Query(max_length=200, description="Id of a regression of this campaign, to be told of in it.")
    ] = None,
) -> Response:
    """Bounds and coverage as JSON; with funnel, failures, pictures, limits and commands as one page or as Markdown.

    Search results are no crash rate: bounds come from the i.i.d. phase alone, and there are none without one.
    """
    played = None if regression is None else await run_in_threadpool(_played, service, campaign, regression)
    answer = await reported(
        request,
        service,
        campaign,
        "report",
        *("report", format_, *([played.id] if played else [])),
        format=format_,
        address=str(request.base_url),
        regression=Regression(ego=played.ego, cases=played.cases) if played else None,
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
