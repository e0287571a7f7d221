"""/v1/networks: upload, list, read, delete."""

import asyncio
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.concurrency import run_in_threadpool

from risk_sac.failures.net import RoadsBody
from risk_sac.maps.documents import MAX_BYTES, MAX_FILES, MAX_ROADS
from service.api.context import CurrentCaller, Service
from service.api.pages import INVALID, UNKNOWN, WAIT, WRONG_TYPE, Cursor, Limit, Responses, header, link, problem
from service.api.posted import media_type
from service.api.problems import ProblemError, Reason
from service.networks.schemas import MEDIA_TYPES, WALL_S, Network, NetworkPage, Places
from service.networks.surveys import RETRY_AFTER_S

LISTED = "networks"
RECEIVE_S = 60  # a sender that is slower would keep others out
LOCATED = {"Location": header("Where it is.")}
CREATED: Responses = {
    200: {"model": Network, "description": "The same bytes were uploaded before", "headers": LOCATED},
    201: {"headers": LOCATED},
}
REFUSALS: Responses = (
    problem(409, "The project has as many networks as it may")
    | WRONG_TYPE
    | problem(422, "The upload is refused, and `detail` says why; or a query parameter is wrong")
)
FINDING = problem(422, "Nothing can be found on the network, and `detail` says why")
SEARCHING: Responses = {
    202: {"model": Places, "description": "They are still searched for; `progress` says how far", "headers": WAIT}
}
DRAWN: Responses = {200: {"content": {"image/png": {}}}}
DESCRIPTION = f"""Check a SUMO road network and keep it. Its `places` are where campaigns can be run on it.

The body is a net (`.net.xml`), an OpenStreetMap extract or OpenDRIVE, the same as gzip, or a zip archive of one map \
and up to {MAX_FILES - 1} route and additional files. Its content tells what it is. What is no present net is \
converted by SUMO's netconvert; `warnings` has its remarks and the side of traffic. At most {MAX_BYTES >> 20} MiB \
unpacked, {MAX_ROADS} edges and {WALL_S} s. What names a file or writes output is refused. The same bytes again give \
the network that there is, under its old label."""
DOCUMENTED_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {name: {"schema": {"type": "string", "format": "binary"}} for name in MEDIA_TYPES},
    }
}

router = APIRouter(prefix="/v1/networks", tags=["networks"], responses=INVALID)


def _refuse_other_types(request: Request) -> None:
    media_type(request, MEDIA_TYPES)


@router.post(
    "",
    status_code=201,
    responses=CREATED | REFUSALS,
    description=DESCRIPTION,
    openapi_extra=DOCUMENTED_BODY,
    dependencies=[Depends(_refuse_other_types)],
)
async def post_network(
    request: Request,
    response: Response,
    service: Service,
    caller: CurrentCaller,
    label: Annotated[str, Query(max_length=200, description="A note of your own.")] = "",
) -> Network:
    """Receives, checks and stores an upload."""
    try:
        with service.networks.receive(caller.key_id) as incoming:
            async with asyncio.timeout(RECEIVE_S):
                async for chunk in request.stream():
                    incoming.write(chunk)
            network = await run_in_threadpool(service.networks.uploaded_before, incoming, caller.project)
            if network is None:
                network = await run_in_threadpool(service.networks.add, incoming, caller.project, label)
            else:
                response.status_code = HTTPStatus.OK
    except TimeoutError as error:
        detail = f"the body took longer than {RECEIVE_S} s; wanted it faster"
        raise ProblemError(HTTPStatus.REQUEST_TIMEOUT, Reason.UPLOAD_TOO_SLOW, detail) from error
    response.headers["Location"] = link(request, f"/v1/networks/{network.id}")
    return network


@router.get("")
def list_networks(service: Service, caller: CurrentCaller, limit: Limit = 50, cursor: Cursor = None) -> NetworkPage:
    """Uploaded networks, newest first."""
    page = service.networks.list(limit, service.cursors.decode(cursor, LISTED, caller.sees), caller.sees)
    return NetworkPage(items=list(page.items), next=service.cursors.encode(page.last, LISTED, caller.sees))


@router.get("/{network_id}", responses=UNKNOWN)
def get_network(network_id: str, service: Service, caller: CurrentCaller) -> Network:
    """Content and files of a network."""
    return service.networks.get(network_id, caller.sees)


@router.get("/{network_id}/places", responses=UNKNOWN | FINDING | SEARCHING)
def get_places(network_id: str, response: Response, service: Service, caller: CurrentCaller) -> Places:
    """Places where the patterns fit, and reasons elsewhere; searched at first request."""
    places = service.surveys.places(network_id, caller.sees)
    if places.progress < 1:
        response.status_code = HTTPStatus.ACCEPTED
        response.headers["Retry-After"] = str(RETRY_AFTER_S)
    return places


@router.get("/{network_id}/places.png", response_class=Response, responses=UNKNOWN | FINDING | DRAWN)
def get_places_picture(network_id: str, service: Service, caller: CurrentCaller) -> Response:
    """Picture of the network with its places."""
    return Response(service.surveys.picture(network_id, caller.sees), media_type="image/png")


@router.get("/{network_id}/roads", response_model=RoadsBody, responses=UNKNOWN | FINDING)
def get_network_roads(network_id: str, service: Service, caller: CurrentCaller) -> Response:
    """Ground of the network as polygons, in its own coordinates."""
    return Response(service.surveys.roads(network_id, caller.sees), media_type="application/json")


@router.delete("/{network_id}", status_code=204, responses=UNKNOWN)
def delete_network(network_id: str, service: Service, caller: CurrentCaller) -> None:
    """Delete a network and its files."""
    service.networks.delete(network_id, caller.sees)
