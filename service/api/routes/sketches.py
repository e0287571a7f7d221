"""/v1/campaigns/{id}/failures/{id}/…: what a page shows of a collision, made at once.

Sync routes, so that it is made in FastAPI's thread pool.
"""

from http import HTTPStatus

from fastapi import APIRouter, Request, Response

from service.api.answers.problems import ProblemError
from service.api.answers.representations import Representation, caching, entity_tag, has, not_modified
from service.api.answers.responses import INVALID, STORAGE, TAGGED, UNKNOWN, problem
from service.api.context import Service
from service.api.routes.pictures import Asked
from service.errors import StorageError
from service.schemas.failures import Roads
from service.schemas.problems import Reason
from service.views.pictures import roads_body, thumbnail_of

SVG = "image/svg+xml"
THUMBNAIL = TAGGED | {200: TAGGED[200] | {"content": {SVG: {}}}}
LOST = problem(404, "Nothing has this id, or its time series is lost")

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["campaigns"], responses=STORAGE | INVALID | UNKNOWN)


@router.get("/failures/{failure_id}/roads", response_model=Roads, responses=TAGGED)
def get_roads(contact: Asked, request: Request) -> Response:
    """The ground on which a collision came about, as polygons on the map that its time series is on."""
    tag = entity_tag(contact.edition)
    return Representation(roads_body(contact).model_dump_json().encode(), tag, caching(tag)).response(request)


@router.get("/failures/{failure_id}/thumbnail.svg", response_class=Response, responses=THUMBNAIL | LOST)
def get_thumbnail(contact: Asked, request: Request, service: Service) -> Response:
    """One collision from above, small: the roads, both paths in the last 3 s, and both bodies as they touch."""
    tag = entity_tag(contact.edition)
    if has(request, tag):
        return not_modified(tag)
    try:
        drawn = thumbnail_of(contact, service.settings)
    except StorageError as error:
        detail = f"{contact.episode.id!r} cannot be shown: {error}"
        raise ProblemError(HTTPStatus.NOT_FOUND, Reason.SERIES_LOST, detail) from error
    return Response(drawn, headers=caching(tag), media_type=SVG)
