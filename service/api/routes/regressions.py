"""/v1/regressions: a campaign's failures against another ego."""

from typing import Annotated

from fastapi import APIRouter, Depends, Request, Response
from fastapi.concurrency import run_in_threadpool
from pydantic import Field

from risk_sac.config import EgoConfig
from risk_sac.config.base import Settings
from risk_sac.failures.cases import CampaignRegression
from service.api.context import CurrentCaller, Service
from service.api.pages import INVALID, MALFORMED, NOT_JSON, UNKNOWN, Responses, header, link, problem
from service.api.posted import documented, read_posted
from service.runs.regressions import campaign_of


class PostedRegression(Settings):
    """Campaign and ego of a regression."""

    campaign_id: Annotated[str, Field(max_length=100, pattern=r"^[A-Za-z0-9]+$")]
    """Ended campaign whose distinct failures are played."""
    ego: EgoConfig
    """The other ego, such as `{"profile": "careful"}`."""


POSTING: Responses = (
    {202: {"headers": {"Location": header("Where to follow it.")}}}
    | MALFORMED
    | NOT_JSON
    | UNKNOWN
    | problem(409, "The campaign has not ended, or none of its runs has succeeded")
)

router = APIRouter(prefix="/v1/regressions", tags=["regressions"], responses=INVALID)


async def _posted(request: Request) -> PostedRegression:
    return await read_posted(request, PostedRegression)


@router.post("", status_code=202, responses=POSTING, openapi_extra=documented("PostedRegression"))
async def post_regression(
    posted: Annotated[PostedRegression, Depends(_posted)],
    request: Request,
    response: Response,
    service: Service,
    caller: CurrentCaller,
) -> CampaignRegression:
    """Play the distinct failures of a campaign against another ego; the same request returns the existing one."""
    campaign = await run_in_threadpool(service.store.campaign, posted.campaign_id, caller.sees)
    regression = await run_in_threadpool(service.regressions.post, campaign, posted.ego, caller.key_id)
    response.headers["Location"] = link(request, f"/v1/regressions/{regression.id}")
    return regression


@router.get("/{regression_id}", responses=UNKNOWN)
def get_regression(regression_id: str, service: Service, caller: CurrentCaller) -> CampaignRegression:
    """Verdict of each failure: fixed, still failing, a new kind, flaky, or not comparable, with the reason."""
    service.store.campaign(campaign_of(regression_id), caller.sees)  # which another project's caller does not see
    return service.regressions.get(regression_id)
