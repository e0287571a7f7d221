"""/v1/campaigns/{id}/failures/{id}/…: what a page draws of a collision, which is made at once.

Sync routes, so that files are read and written out in FastAPI's thread pool.
"""

from fastapi import APIRouter, Request, Response

from service.api.answers.representations import Representation, caching, entity_tag
from service.api.answers.responses import INVALID, STORAGE, TAGGED, UNKNOWN
from service.api.routes.pictures import Asked
from service.schemas.failures import Roads
from service.views.sketches import roads_body

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["campaigns"], responses=STORAGE | INVALID | UNKNOWN)


@router.get("/failures/{failure_id}/roads", response_model=Roads, responses=TAGGED)
def get_roads(contact: Asked, request: Request) -> Response:
    """The ground on which a collision came about, as polygons on the map that its time series is on."""
    tag = entity_tag(contact.edition)
    return Representation(roads_body(contact).model_dump_json().encode(), tag, caching(tag)).response(request)
