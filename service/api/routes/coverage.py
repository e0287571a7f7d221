"""/v1/coverage: what all campaigns of a project have covered together."""

from typing import Annotated

from fastapi import APIRouter, Query, Response
from starlette.concurrency import run_in_threadpool

from risk_sac.records.coverage import CoverageMatrix
from risk_sac.report.matrix import ego_name, merged
from service.api.context import CurrentCaller, Service
from service.api.pages import CROWDED, INVALID, STORAGE, as_json
from service.views.whole import CampaignView

MOST = 100  # campaigns: each takes up to seconds the first time
router = APIRouter(prefix="/v1/coverage", tags=["reports"], responses=STORAGE | INVALID)


@router.get("", response_model=CoverageMatrix, responses=CROWDED)
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
    limit: Annotated[int, Query(ge=1, le=MOST, description="Newest campaigns to be merged.")] = MOST,
) -> Response:
    """Coverage of the newest campaigns of a project, cell by cell; each cell names the campaigns behind it.

    Campaigns of different egos are merged too, unless `ego` picks one: what one ego kept, another need not.
    """
    page = await run_in_threadpool(service.store.campaigns, limit, project=caller.sees, label=label)
    matrices = []
    for campaign in page.items:
        if ego is not None and ego_name(campaign.spec) != ego:
            continue
        edition = await run_in_threadpool(service.reports.edition, campaign)
        view = CampaignView(name="coverage", campaign_id=campaign.id, edition=edition)
        content = await service.views.content(view, campaign, caller.key_id)
        matrices.append(CoverageMatrix.model_validate_json(content.body))
    return as_json(merged(matrices))
