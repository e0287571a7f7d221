"""/v1/scenarios: post, list, read, draw, check and delete."""

import asyncio
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.concurrency import run_in_threadpool

from risk_sac.maps.documents import MAX_BYTES, MAX_FILES
from risk_sac.records.campaign import ScenarioCheck, ScenarioDetails, ScenarioList
from risk_sac.scenario.reading import MOST_BYTES
from service.api.context import CurrentCaller, Service
from service.api.pages import INVALID, UNKNOWN, WRONG_TYPE, Responses, header, link, problem
from service.api.posted import media_type
from service.api.problems import ProblemError, Reason
from service.networks.schemas import ZIPPED

MEDIA_TYPES = ("application/json", "application/yaml", "application/zip")
RECEIVE_S = 60
LOCATED = {"Location": header("Where it is.")}
CREATED: Responses = {
    200: {"model": ScenarioDetails, "description": "The same was posted before", "headers": LOCATED},
    201: {"headers": LOCATED},
}
REFUSALS: Responses = WRONG_TYPE | problem(
    422, "The document has faults; each is one of `errors`, whose `field` is its path in the document"
)
FULL = problem(409, "The project has as many scenarios as it may")
IN_USE = problem(409, "It ships with the service, or a campaign names it")
DRAWN: Responses = {200: {"content": {"image/png": {}}}}
BODY = f"""The body is the document as JSON or YAML, at most {MOST_BYTES} bytes, or a zip archive of it and its nets, \
at most {MAX_FILES} files and {MAX_BYTES >> 20} MiB once unpacked. A net is one of those that ship, or a file of the \
archive that `network` names. Or it is a zip archive of an OpenSCENARIO scenario, and of its variation file if it has \
one, with their catalogs and OpenDRIVE roads; the document's `origin` says what was not read."""
DOCUMENTED_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {"schema": {"type": "object"}},
            "application/yaml": {"schema": {"type": "string"}},
            "application/zip": {"schema": {"type": "string", "format": "binary"}},
        },
    }
}

EgoEntity = Annotated[
    str, Query(max_length=200, pattern=r"^[^\x00]*$", description="Entity of OpenSCENARIO that is the ego.")
]

router = APIRouter(prefix="/v1/scenarios", tags=["scenarios"], responses=INVALID)


def _refuse_other_types(request: Request) -> None:
    media_type(request, MEDIA_TYPES, hint=ZIPPED)


async def _received(request: Request) -> bytes:
    try:
        async with asyncio.timeout(RECEIVE_S):
            return await request.body()
    except TimeoutError as error:
        detail = f"the body took longer than {RECEIVE_S} s; wanted it faster"
        raise ProblemError(HTTPStatus.REQUEST_TIMEOUT, Reason.UPLOAD_TOO_SLOW, detail) from error


@router.post(
    "",
    status_code=201,
    responses=CREATED | REFUSALS | FULL,
    description=f"Check a scenario document and keep it. {BODY} Campaigns name it by `name`, which holds a digest.",
    openapi_extra=DOCUMENTED_BODY,
    dependencies=[Depends(_refuse_other_types)],
)
async def post_scenario(
    request: Request, response: Response, service: Service, caller: CurrentCaller, ego_entity: EgoEntity = ""
) -> ScenarioDetails:
    """Keeps a document and its nets."""
    upload = await _received(request)
    kept, new = await run_in_threadpool(service.scenarios.add, upload, caller.project, ego_entity)
    response.status_code = HTTPStatus.CREATED if new else HTTPStatus.OK
    response.headers["Location"] = link(request, f"/v1/scenarios/{kept.name}")
    return kept


@router.post(
    "/check",
    responses=REFUSALS,
    description="Check a document as `POST /v1/scenarios` does, and play 20 scenes without an attack. It is not kept.",
    openapi_extra=DOCUMENTED_BODY,
    dependencies=[Depends(_refuse_other_types)],
)
async def check_scenario(
    request: Request, service: Service, caller: CurrentCaller, ego_entity: EgoEntity = ""
) -> ScenarioCheck:
    """Checks a document, and plays scenes of it."""
    return await run_in_threadpool(service.scenarios.check, await _received(request), ego_entity)


@router.get("")
def list_scenarios(service: Service, caller: CurrentCaller) -> ScenarioList:
    """Scenarios that ship, then the project's own, newest first."""
    times = service.store.episode_times()
    items = service.scenarios.list(caller.sees)
    return ScenarioList(items=[row.model_copy(update={"episode_s": times.get(row.name, {})}) for row in items])


@router.get("/{scenario}", responses=UNKNOWN)
def get_scenario(scenario: str, service: Service, caller: CurrentCaller) -> ScenarioDetails:
    """A scenario with its document as YAML."""
    return service.scenarios.get(scenario, caller.sees)


@router.get("/{scenario}/picture.png", response_class=Response, responses=UNKNOWN | DRAWN)
async def get_scenario_picture(scenario: str, service: Service, caller: CurrentCaller) -> Response:
    """Picture of a scenario's beginning from above, with actors' possible starts."""
    await run_in_threadpool(service.scenarios.get, scenario, caller.sees)
    return Response(await service.scenario_pictures.get(scenario, caller.key_id), media_type="image/png")


@router.delete("/{scenario}", status_code=204, responses=UNKNOWN | IN_USE)
def delete_scenario(scenario: str, service: Service, caller: CurrentCaller) -> None:
    """Delete a scenario that no campaign names."""
    service.scenarios.delete(scenario, caller.sees, service.store.families)
