"""/v1/campaigns/{id}/failures/{id}/picture.png: how a collision came about, for people to look at."""

from http import HTTPStatus

from fastapi import APIRouter, Request, Response
from starlette.concurrency import run_in_threadpool

from service.api.access import CurrentCaller
from service.api.answers.problems import ProblemError
from service.api.answers.representations import caching, entity_tag, has, not_modified
from service.api.answers.responses import INVALID, STORAGE, TAGGED, UNKNOWN, Responses, header, problem
from service.api.context import Service
from service.errors import StorageError
from service.schemas.problems import Reason
from service.views.pictures import Subject, TooManyWaiting

PNG = "image/png"
RETRY_AFTER_S = 2  # in which some of those who wait get their pictures
PICTURE: Responses = TAGGED | {
    200: TAGGED[200] | {"content": {PNG: {}}},
    **problem(404, "Nothing has this id, or its time series is lost"),
    503: STORAGE[503]
    | {
        "description": "The database cannot be read, or too many pictures wait to be drawn",
        "headers": {"Retry-After": header("Seconds until asking again pays.", "integer", required=False)},
    },
}

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["campaigns"], responses=STORAGE | INVALID | UNKNOWN)


@router.get("/failures/{failure_id}/picture.png", response_class=Response, responses=PICTURE)
async def get_picture(
    campaign_id: str, failure_id: str, request: Request, service: Service, caller: CurrentCaller
) -> Response:
    """One collision, valid or not: both paths from above, and what was measured along the way."""
    campaign = await run_in_threadpool(service.store.campaign, campaign_id, caller.sees)
    episode = await run_in_threadpool(service.store.failure, campaign_id, failure_id, caller.sees)
    subject = Subject.of(campaign, episode)
    tag = entity_tag(subject.edition)
    if has(request, tag):
        return not_modified(tag)
    try:
        content = await service.pictures.png(subject)
    except StorageError as error:
        detail = f"{failure_id!r} cannot be drawn: {error}"
        raise ProblemError(HTTPStatus.NOT_FOUND, Reason.SERIES_LOST, detail) from error
    except TooManyWaiting as error:
        wait = {"Retry-After": str(RETRY_AFTER_S)}
        raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.PICTURES_BUSY, str(error), headers=wait) from error
    return Response(content, headers=caching(tag), media_type=PNG)
