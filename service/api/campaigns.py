"""/v1/campaigns: post, follow, read, cancel."""

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response

from risk_sac.types import Outcome
from service import records
from service.api.body import DOCUMENTED_BODY, PostedCampaign
from service.api.context import Service
from service.api.pages import Cursor, Limit, decode_cursor, encode_cursor
from service.api.responses import INVALID, MALFORMED, NOT_JSON, STORAGE, UNKNOWN, Responses
from service.api.views import campaign_body, episode_body, failure_body, summary_body, tier_outcomes
from service.records import Page
from service.results import results
from service.schemas import Campaign, CampaignPage, EpisodePage, Failure, Results

POLL_S = 1
ACCEPTED: Responses = {
    202: {
        "headers": {
            "Location": {"description": "Where to follow it.", "required": True, "schema": {"type": "string"}},
            "Retry-After": {
                "description": "Seconds until a look pays.",
                "required": True,
                "schema": {"type": "integer"},
            },
        }
    }
}

router = APIRouter(prefix="/v1/campaigns", tags=["campaigns"], responses=STORAGE | INVALID)


@router.post("", status_code=202, responses=ACCEPTED | MALFORMED | NOT_JSON, openapi_extra=DOCUMENTED_BODY)
def post_campaign(spec: PostedCampaign, service: Service, response: Response) -> Campaign:
    """Queue a campaign: families × methods × seeds on one equal budget."""
    campaign = service.manager.submit(spec)
    response.headers["Location"] = f"/v1/campaigns/{campaign.id}"
    response.headers["Retry-After"] = str(POLL_S)
    return campaign_body(campaign, service.settings)


@router.get("")
def list_campaigns(service: Service, limit: Limit = 50, cursor: Cursor = None) -> CampaignPage:
    """All campaigns, newest first."""
    page = service.store.campaigns(limit, decode_cursor(cursor))
    items = [summary_body(campaign, service.settings) for campaign in page.items]
    return CampaignPage(items=items, next=encode_cursor(page.last))


@router.get("/{campaign_id}", responses=UNKNOWN)
def get_campaign(campaign_id: str, service: Service) -> Campaign:
    """State, progress and runs of a campaign."""
    return campaign_body(service.store.campaign(campaign_id), service.settings)


@router.get("/{campaign_id}/results", responses=UNKNOWN)
def get_results(campaign_id: str, service: Service) -> Results:
    """What a campaign has found; partial until it has ended."""
    return results(service.store.campaign(campaign_id))


@router.get("/{campaign_id}/episodes", responses=UNKNOWN)
def list_episodes(
    campaign_id: str,
    service: Service,
    run: Annotated[str | None, Query(description="Only episodes of this run.")] = None,
    outcome: Annotated[Outcome | None, Query(description="Only episodes that ended so.")] = None,
    limit: Limit = 50,
    cursor: Cursor = None,
) -> EpisodePage:
    """Episodes of a campaign in the order of their arrival."""
    outcomes = () if outcome is None else (outcome,)
    after = decode_cursor(cursor)
    page = service.store.episodes(campaign_id, limit=limit, after=after, run_id=run, outcomes=outcomes)
    return _episode_page(page)


@router.get("/{campaign_id}/failures", responses=UNKNOWN)
def list_failures(
    campaign_id: str,
    service: Service,
    tier: Annotated[Literal["valid", "raw"], Query(description="`raw` adds contacts that a rule refused.")] = "valid",
    run: Annotated[str | None, Query(description="Only failures of this run.")] = None,
    limit: Limit = 50,
    cursor: Cursor = None,
) -> EpisodePage:
    """Collisions of the ego in the order of their arrival."""
    after = decode_cursor(cursor)
    page = service.store.episodes(campaign_id, limit=limit, after=after, run_id=run, outcomes=tier_outcomes(tier))
    return _episode_page(page)


@router.get("/{campaign_id}/failures/{failure_id}", responses=UNKNOWN)
def get_failure(campaign_id: str, failure_id: str, service: Service) -> Failure:
    """One collision, valid or not, with its full time series."""
    return failure_body(campaign_id, service.store.failure(campaign_id, failure_id), service.settings)


@router.post("/{campaign_id}/cancel", status_code=202, responses=UNKNOWN)
def cancel_campaign(campaign_id: str, service: Service) -> Campaign:
    """Stop a campaign and keep what it found; changes nothing once it has ended."""
    return campaign_body(service.manager.cancel(campaign_id), service.settings)


def _episode_page(page: Page[records.Episode]) -> EpisodePage:
    return EpisodePage(items=[episode_body(episode) for episode in page.items], next=encode_cursor(page.last))
