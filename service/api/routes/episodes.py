"""/v1/campaigns/{id}/episodes and failures."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response
from pydantic import Field

from risk_sac.config.base import Settings
from risk_sac.records import (
    DrivenBy,
    Episode,
    EpisodePage,
    Failure,
    Fault,
    Grade,
    Outcome,
    Severity,
    Triage,
    TriageState,
)
from service.api.answers.pages import TIERS, Cursor, Limit, Tier
from service.api.answers.representations import as_json
from service.api.answers.responses import INVALID, MALFORMED, NOT_JSON, STORAGE, UNKNOWN
from service.api.context import CurrentCaller, Service
from service.api.posted import documented, read_posted
from service.api.requirements import AskedRequirement
from service.store.finding import Judged
from service.store.stored import StoredPage
from service.views.series import failure_body

# Text of any language, with tabs and new lines; other control characters could hide or reorder what is shown.
TEXT = r"^[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$"

AskedDrivenBy = Annotated[DrivenBy | None, Query(description="Only those whose adversaries this drove.")]


class PostedTriage(Settings):
    """Triage to store for a failure."""

    state: TriageState
    """new: undecided; confirmed: the ego has to be fixed; dismissed: it has not; fixed: it has been."""
    comment: Annotated[str, Field(max_length=2000, pattern=TEXT)] = ""
    """Reason, as plain text."""


router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["campaigns"], responses=STORAGE | INVALID | UNKNOWN)


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
    severity: Annotated[Severity | None, Query(description="Only contacts as bad as this.")] = None,
    fault: Annotated[Fault | None, Query(description="Only those that this party caused.")] = None,
    driven_by: AskedDrivenBy = None,
    broke: Annotated[
        str | None, Query(max_length=40, pattern="^[a-z_]+$", description="Only those whose striker broke this.")
    ] = None,
    signature: Annotated[
        str | None, Query(max_length=300, pattern=r"^[^\x00]*$", description="Only those with exactly this signature.")
    ] = None,
    limit: Limit = 50,
    cursor: Cursor = None,
) -> Response:
    """Failures in order of arrival: violations of requirements that count, contacts included."""
    page = service.store.episodes(
        campaign_id,
        limit=limit,
        after=service.cursors.decode(cursor, campaign_id, caller.sees),
        run_id=run,
        outcomes=TIERS[tier],
        judged=Judged(
            requirement=requirement,
            valid=tier == "valid",
            grade=grade,
            severity=severity,
            fault=fault,
            driven_by=driven_by,
            broke=broke,
            signature=signature,
            iid=run is not None,
        ),
        project=caller.sees,
    )
    return _page(page, service.cursors.encode(page.last, campaign_id, caller.sees))


@router.get("/failures/{failure_id}", response_model=Failure)
def get_failure(campaign_id: str, failure_id: str, service: Service, caller: CurrentCaller) -> Response:
    """One failure, valid or not, with its full time series."""
    failure = service.store.failure(campaign_id, failure_id, caller.sees)
    triage = service.store.triage(campaign_id, failure_id, caller.sees)
    return as_json(failure_body(campaign_id, failure, triage, service.settings))


@router.put("/failures/{failure_id}/triage", responses=MALFORMED | NOT_JSON, openapi_extra=documented("PostedTriage"))
def put_triage(
    campaign_id: str,
    failure_id: str,
    posted: Annotated[PostedTriage, Depends(_posted_triage)],
    service: Service,
    caller: CurrentCaller,
) -> Triage:
    """Store the triage of a failure, replacing an earlier one; it is deleted with the campaign."""
    return service.manager.triage(campaign_id, failure_id, posted.state, posted.comment, caller.sees)


def _page(page: StoredPage[Episode], cursor: str | None) -> Response:
    return as_json(EpisodePage(items=list(page.items), next=cursor))
