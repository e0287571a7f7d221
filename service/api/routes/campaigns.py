"""/v1/campaigns: post, list, cancel, delete."""

from hashlib import blake2b
from typing import Annotated

from fastapi import APIRouter, Header, Query, Request, Response

from risk_sac.config import FamilyName, MethodName
from service.api.access import CurrentCaller
from service.api.answers.pages import Cursor, Limit, decode_cursor, encode_cursor
from service.api.answers.representations import Representation, caching, entity_tag
from service.api.answers.responses import (
    ACCEPTED,
    INVALID,
    MALFORMED,
    NOT_ENDED,
    NOT_JSON,
    REUSED,
    STORAGE,
    TAGGED,
    UNKNOWN,
)
from service.api.context import Service
from service.api.live import waiting
from service.api.posted_campaign import DOCUMENTED_BODY, PostedCampaign
from service.api.recall import remember
from service.schemas import Campaign, CampaignPage
from service.store.records import StoredCampaign
from service.store.states import State
from service.views.bodies import campaign_body, summary_body

POSTING = ACCEPTED | MALFORMED | REUSED | NOT_JSON
IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        pattern=r"^[\x21-\x7e]+$",
        description="Any string of the client's own. Posting the same campaign again with the same key gives the"
        " campaign that there is, so that a client that got no answer can simply try again.",
    ),
]

router = APIRouter(prefix="/v1/campaigns", tags=["campaigns"], responses=STORAGE | INVALID)


@router.post("", status_code=202, response_model=Campaign, responses=POSTING, openapi_extra=DOCUMENTED_BODY)
def post_campaign(
    spec: PostedCampaign, service: Service, caller: CurrentCaller, idempotency_key: IdempotencyKey = None
) -> Response:
    """Queue a campaign: families × methods × seeds on one equal budget."""
    campaign = service.manager.submit(spec, project=caller.project, key=idempotency_key)
    return _accepted(campaign, service)


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
    limit: Limit = 50,
    cursor: Cursor = None,
) -> Response:
    """Campaigns, newest first; what is posted meanwhile comes before the first page."""
    mark = service.store.mark_of_all()
    page = service.store.campaigns(
        limit,
        decode_cursor(cursor),
        project=caller.sees,
        state=state,
        family=family,
        method=method,
        label=label,
    )
    items = [summary_body(campaign, service.settings) for campaign in page.items]
    body = CampaignPage(items=items, next=encode_cursor(page.last)).model_dump_json().encode()
    tag = entity_tag(blake2b(body, digest_size=8).hexdigest())
    representation = Representation(body, tag, caching(tag))
    remember(request, representation, mark)
    return representation.response(request)


@router.post("/{campaign_id}/cancel", status_code=202, response_model=Campaign, responses=UNKNOWN | ACCEPTED)
def cancel_campaign(campaign_id: str, service: Service, caller: CurrentCaller) -> Response:
    """Stop a campaign and keep what it found; changes nothing once it has ended."""
    campaign = service.manager.cancel(campaign_id, caller.sees)
    service.live.expire(campaign_id)
    return _accepted(campaign, service)


@router.delete("/{campaign_id}", status_code=204, responses=UNKNOWN | NOT_ENDED)
def delete_campaign(campaign_id: str, service: Service, caller: CurrentCaller) -> None:
    """Remove a campaign that has ended, with all that it found and its files."""
    service.manager.delete(campaign_id, caller.sees)


def _accepted(campaign: StoredCampaign, service: Service) -> Response:
    headers = {"Location": f"/v1/campaigns/{campaign.id}"} | waiting(campaign, service.settings)
    body = campaign_body(campaign, service.settings).model_dump_json()
    return Response(body, status_code=202, headers=headers, media_type="application/json")
