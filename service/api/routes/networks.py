"""/v1/networks: upload, list, look, delete."""

import asyncio
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from service.api.access import CurrentCaller
from service.api.answers.pages import Cursor, Limit, decode_cursor, encode_cursor
from service.api.answers.problems import ProblemError
from service.api.answers.responses import INVALID, STORAGE, UNKNOWN, Responses, header, problem
from service.api.context import Service
from service.networks.errors import BusyError, UploadError
from service.networks.limits import MAX_EDGES, MAX_EXPANDED_BYTES, MAX_FILES, WALL_S
from service.networks.packaging import MEDIA_TYPES, Packaging
from service.networks.schemas import Network, NetworkPage
from service.schemas.problems import Reason

RECEIVE_S = 60  # a sender that is slower would keep others out
CREATED: Responses = {201: {"headers": {"Location": header("Where it is.")}}}
REFUSALS: Responses = (
    problem(400, "The body ended early")
    | problem(408, f"The body took longer than {RECEIVE_S} s")
    | problem(409, "The project has as many networks as it may")
    | problem(415, "The body is declared as something else, or carries a Content-Encoding")
    | problem(422, "The upload is refused, and `detail` says why; or a query parameter is wrong")
    | problem(503, "The disk refuses; or there are too many uploads at once, and Retry-After says when to come again")
)
REFUSALS[503]["headers"] = {"Retry-After": header("Seconds until asking again pays.", "integer", required=False)}
DESCRIPTION = f"""Check a SUMO road network and keep it. Campaigns cannot run on it yet: families bring their own roads.

The body is a net (`.net.xml`), the same as gzip, or a zip archive of one net and up to {MAX_FILES - 1} route and \
additional files; what a file is, its root element says. UTF-8, at most {MAX_EXPANDED_BYTES >> 20} MiB once unpacked \
and {MAX_EDGES} edges, those inside junctions included. What names a file, includes one or writes output is refused. \
What was read is written anew and loaded by the simulator once, in a process that may take {WALL_S} s; only that is \
kept, without comments, under names of the service's own."""
DOCUMENTED_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {name: {"schema": {"type": "string", "format": "binary"}} for name in MEDIA_TYPES},
    }
}

router = APIRouter(prefix="/v1/networks", tags=["networks"], responses=STORAGE | INVALID)


def _packaging(request: Request) -> Packaging:
    declared = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if declared not in MEDIA_TYPES:
        raise _unsupported(f"content-type is {declared[:100]!r}; wanted one of {', '.join(MEDIA_TYPES)}")
    encoding = request.headers.get("content-encoding", "identity")
    if encoding.lower() != "identity":
        raise _unsupported(f"content-encoding is {encoding[:100]!r}; wanted none: send the file as it is")
    return MEDIA_TYPES[declared]


def _unsupported(detail: str) -> ProblemError:
    return ProblemError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, Reason.UNSUPPORTED_MEDIA_TYPE, detail)


@router.post("", status_code=201, responses=CREATED | REFUSALS, description=DESCRIPTION, openapi_extra=DOCUMENTED_BODY)
async def post_network(
    request: Request,
    response: Response,
    service: Service,
    caller: CurrentCaller,
    packaging: Annotated[Packaging, Depends(_packaging)],
    label: Annotated[str, Query(max_length=200, description="A note of your own.")] = "",
) -> Network:
    """Receive an upload, have it checked, and keep it."""
    try:
        with service.networks.receive() as incoming:
            async with asyncio.timeout(RECEIVE_S):
                async for chunk in request.stream():
                    incoming.write(chunk)
            network = await run_in_threadpool(service.networks.add, incoming, packaging, caller.project, label)
    except UploadError as error:
        raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, Reason.UPLOAD_REFUSED, str(error)) from error
    except BusyError as error:
        headers = {"Retry-After": str(error.retry_after_s)}
        raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.UPLOADS_BUSY, str(error), headers=headers) from error
    except TimeoutError as error:
        detail = f"the body took longer than {RECEIVE_S} s; wanted it faster"
        raise ProblemError(HTTPStatus.REQUEST_TIMEOUT, Reason.UPLOAD_TOO_SLOW, detail) from error
    except ClientDisconnect as error:
        raise ProblemError(HTTPStatus.BAD_REQUEST, Reason.UPLOAD_INCOMPLETE, "the body ended early") from error
    response.headers["Location"] = f"/v1/networks/{network.id}"
    return network


@router.get("")
def list_networks(service: Service, caller: CurrentCaller, limit: Limit = 50, cursor: Cursor = None) -> NetworkPage:
    """Uploaded networks, newest first."""
    page = service.networks.list(limit, decode_cursor(cursor), caller.sees)
    return NetworkPage(items=list(page.items), next=encode_cursor(page.last))


@router.get("/{network_id}", responses=UNKNOWN)
def get_network(network_id: str, service: Service, caller: CurrentCaller) -> Network:
    """What a network has, and which files it is kept as."""
    return service.networks.get(network_id, caller.sees)


@router.delete("/{network_id}", status_code=204, responses=UNKNOWN)
def delete_network(network_id: str, service: Service, caller: CurrentCaller) -> None:
    """Remove a network and its files."""
    service.networks.delete(network_id, caller.sees)
