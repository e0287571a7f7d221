"""/v1/campaigns/{id}/report: failures, bounds of the i.i.d. phase, and coverage.

A sync route, so that it is made in FastAPI's thread pool.
"""

import shlex
from dataclasses import replace
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response

from risk_sac.benchmark.power import played_by, power_of
from risk_sac.failures.cases import Regression
from risk_sac.records import State
from risk_sac.report import FinishedRun
from risk_sac.report.document import Origin, report_page
from risk_sac.report.evidence import Evidence, gathered
from risk_sac.report.rendering import POLICY
from service.api.answers.responses import INVALID, STORAGE, UNACCEPTABLE, UNKNOWN, Responses, problem
from service.api.context import AskedCampaign, Context, Service
from service.api.routes.reports import BY_ACCEPT, FOR_BROWSERS, MEDIA_TYPES, UNCHANGED, chosen, commands, reported, text
from service.errors import ConflictError, NotFoundError
from service.runs.regressions import StoredRegression, campaign_of
from service.store.stored import StoredCampaign
from service.views.reports import CampaignReport

ReportFormat = Literal["json", "html", "md"]
OFFERED = ("json", "html", "md")
REPORT: Responses = {200: text(html="<!doctype html>…", md="# Failures of an ego: low\n\n> **Search…")}
NOT_PLAYED = problem(409, "The regression has not ended, or has failed")

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["reports"], responses=STORAGE | INVALID | UNKNOWN)


@router.get("/report", response_model=Evidence, responses=REPORT | UNCHANGED | UNACCEPTABLE | NOT_PLAYED)
def get_report(
    request: Request,
    service: Service,
    campaign: AskedCampaign,
    format_: Annotated[ReportFormat | None, FOR_BROWSERS] = None,
    regression: Annotated[
        str | None, Query(max_length=200, description="Id of a regression of this campaign, to be told of in it.")
    ] = None,
) -> Response:
    """Bounds and coverage as JSON; with funnel, failures, pictures, limits and commands as one page or as Markdown.

    Search results are no crash rate: bounds come from the i.i.d. phase alone, and there are none without one.
    """
    name = chosen(request, format_, OFFERED)
    played = None if regression is None else _played(service, campaign, regression)
    parts = ("report", name, *([played.id] if played else []))
    made, headers = reported(request, service, campaign, *parts, others=BY_ACCEPT)
    if name == "html":
        headers["Content-Security-Policy"] = f"{POLICY}; frame-ancestors 'none'"
    return Response(_content(request, campaign, made, name, played), headers=headers, media_type=MEDIA_TYPES[name])


def _played(service: Context, campaign: StoredCampaign, regression_id: str) -> StoredRegression:
    """Returns a regression of the campaign that has succeeded."""
    if campaign_of(regression_id) != campaign.id:
        message = f"campaign {campaign.id} has no regression {regression_id!r}"
        raise NotFoundError(message, field="regression", got=regression_id)
    found = service.regressions.get(regression_id)
    if found.state is not State.SUCCEEDED:
        raise ConflictError(f"regression {found.id} is {found.state}; wanted one that succeeded", reason="not_ended")
    return found


def _content(
    request: Request, campaign: StoredCampaign, made: CampaignReport, name: str, played: StoredRegression | None
) -> str:
    command, spec_command = commands(request, campaign.id)
    comparison = replace(made.comparison, command=command, spec_command=spec_command)
    evidence = gathered(comparison)
    if name == "json":
        return evidence.model_dump_json()
    here = f"{request.base_url}v1/campaigns/{campaign.id}"

    def show(run: FinishedRun, failure: str) -> str:
        return shlex.join(["curl", "-s", f"{here}/failures/{failure}/picture.png", "-o", "failure.png"])

    posted = f'{{"campaign_id": "{campaign.id}", "ego": {{"profile": "careful"}}}}'
    origin = Origin(
        report=shlex.join(["curl", "-s", f"{here}/report?format={name}", "-o", f"report.{name}"]),
        data=shlex.join(["curl", "-s", f"{here}/report?format=json"]),
        show=show,
        regress=shlex.join(
            ["curl", f"{request.base_url}v1/regressions", "-H", "content-type: application/json", "-d", posted]
        ),
        folders=made.folders,
        regression=Regression(ego=played.ego, cases=played.cases) if played else None,
    )
    power = power_of(comparison.spec, played_by(comparison.runs))
    return report_page(comparison, evidence, origin, power, "html" if name == "html" else "markdown")
