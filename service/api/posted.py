"""Bodies of requests, and the dependency that checks a filter by requirement."""

import codecs
import json
from collections.abc import Collection
from http import HTTPStatus
from typing import Annotated, Any, Literal, Self, TypeVar

from fastapi import Depends, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, Field, ValidationError, model_validator
from pydantic_core import from_json

from risk_sac.config import CampaignSpec, Settings
from risk_sac.errors import ConfigError
from risk_sac.maps.found import Pattern
from risk_sac.risk.requirements import SHIPPED_REQUIREMENTS
from service.api.context import Caller, Context, CurrentCaller, Service
from service.api.problems import ProblemError, Reason, invalid, invalid_field
from service.errors import NotFoundError


def _known(
    campaign_id: str,
    service: Service,
    caller: CurrentCaller,
    requirement: Annotated[
        str | None,
        Query(
            max_length=40,
            description="Only those that violate it. With `tier=valid` it must count, and the violation be valid.",
        ),
    ] = None,
) -> str | None:
    """Returns the requested requirement; 422 with the campaign's unless it has it."""
    if requirement is None:
        return None
    known = dict.fromkeys([*SHIPPED_REQUIREMENTS, *service.store.own_requirements(campaign_id, caller.sees)])
    if requirement not in known:
        raise invalid_field("requirement", requirement, f"one of: {', '.join(known)}")
    return requirement


AskedRequirement = Annotated[str | None, Depends(_known)]

MOST_MISTAKES = 50  # that a refusal names one by one
MOST_COMMAS = 5_000  # about as many values; validating them holds up all other requests
REFERENCE = "#/components/schemas/{model}"
ON_MAP = "CampaignOnMap"

Model = TypeVar("Model", bound=BaseModel)


async def read_posted(request: Request, model: type[Model]) -> Model:
    """Reads the body of a request.

    Not a body parameter: FastAPI validates the parsed JSON, where strictness would refuse arrays for tuples.
    """
    content, _ = await _read_json(request)
    return _validated(content, model)


async def _read_json(request: Request) -> tuple[bytes, Any]:
    """Returns the body raw and parsed, within limits and without repeated fields."""
    media_type(request, ["application/json"])
    content = (await request.body()).removeprefix(codecs.BOM_UTF8)
    if content.count(b",") > MOST_COMMAS:
        raise invalid(f"the body has more than {MOST_COMMAS} values; wanted fewer: split the request")
    try:
        value = from_json(content)  # which also refuses what is nested too deep for the json module
    except ValueError as error:
        detail = f"the body is no JSON: {error}"
        raise ProblemError(HTTPStatus.BAD_REQUEST, Reason.MALFORMED_JSON, detail) from error
    json.loads(content, object_pairs_hook=_refuse_repeats)
    return content, value


def _refuse_repeats(pairs: list[tuple[str, Any]]) -> None:
    """Refuses an object with a repeated field, which parsers read differently."""
    seen = set[str]()
    for name, _ in pairs:
        if name in seen:
            raise invalid(f"the body has the field {name[:200]!r} twice in one object; wanted it once")
        seen.add(name)


def _validated(content: bytes, model: type[Model]) -> Model:
    try:
        return model.model_validate_json(content, strict=True)
    except ValidationError as error:
        if error.error_count() > MOST_MISTAKES:  # naming them all would keep the server busy
            wanted = f"wanted none. Up to {MOST_MISTAKES} would be named"
            raise invalid(f"the body has {error.error_count()} mistakes; {wanted}") from error
        found = [item | {"loc": ("body", *item["loc"])} for item in error.errors()]
        raise RequestValidationError(found, body=model) from error  # the model: it knows which fields there are


def media_type(request: Request, wanted: Collection[str], hint: str = "") -> str:
    """Returns a body's media type; 415, with `hint`, for others or compression."""
    given = request.headers.get("content-type", "")
    declared = given.partition(";")[0].strip().lower()
    if declared not in wanted:
        example = f"curl -H 'content-type: {next(iter(wanted))}' --data-binary @FILE"
        remedy = f"wanted {' or '.join(wanted)}: send the file alone, as in `{example}`"
        raise _unsupported(f"content-type is {given[:100]!r}; {remedy}{hint and f'. {hint}'}")
    encoding = request.headers.get("content-encoding", "identity")
    if encoding.strip().lower() != "identity":
        raise _unsupported(f"content-encoding is {encoding[:100]!r}; wanted none: send the body as it is")
    return declared


def _unsupported(detail: str) -> ProblemError:
    return ProblemError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, Reason.UNSUPPORTED_MEDIA_TYPE, detail)


class CampaignPlaces(Settings):
    """Network, pattern and places of a campaign."""

    network: Annotated[str, Field(max_length=40)]
    """Id of an uploaded network."""
    pattern: Pattern
    place: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """Where the pattern is played; one of the network's places."""
    places: Literal["all"] | None = None
    """In place of `place`: wherever the pattern fits."""

    @model_validator(mode="after")
    def _one_or_all(self) -> Self:
        if (self.place is None) == (self.places is None):
            raise ConfigError("place", "both or neither", 'either place, one of the network\'s, or places: "all"')
        return self


async def _campaign(request: Request, service: Service, caller: CurrentCaller) -> CampaignSpec:
    content, value = await _read_json(request)
    if isinstance(value, dict) and "scenarios" in value:
        if "families" in value:
            raise invalid_field("scenarios", value["scenarios"], "either scenarios or families, which mean the same")
        value = {"families": value.pop("scenarios")} | value
        content = json.dumps(value).encode()
    if isinstance(value, dict) and "network" in value:
        if "families" in value:
            wanted = "either families or a network with its places, not both"
            raise invalid_field("families", value["families"], wanted)
        where = {name: value.pop(name) for name in CampaignPlaces.model_fields if name in value}
        ground = _validated(json.dumps(where).encode(), CampaignPlaces)
        families = await run_in_threadpool(_families, ground, service, caller)
        content = json.dumps({"families": families} | value).encode()
    spec = _validated(content, CampaignSpec)
    if "\0" in spec.label:  # which PostgreSQL does not take
        raise invalid_field("label", spec.label, "text without NUL")
    return spec


PostedCampaign = Annotated[CampaignSpec, Depends(_campaign)]


def _families(ground: CampaignPlaces, service: Context, caller: Caller) -> list[str]:
    try:
        return service.surveys.keep(ground.network, caller.sees, ground.pattern, ground.place)
    except NotFoundError as error:
        raise invalid_field("network", ground.network, "the id of one of GET /v1/networks") from error


def documented(*models: str) -> dict[str, Any]:
    """Returns the OpenAPI declaration of a body with one of these schemas."""
    schemas = [{"$ref": REFERENCE.format(model=model)} for model in models]
    schema = {"anyOf": schemas} if len(schemas) > 1 else schemas[0]
    return {"requestBody": {"required": True, "content": {"application/json": {"schema": schema}}}}


def input_schemas(model: type[BaseModel]) -> dict[str, Any]:
    """Returns JSON schemas of the body and its parts, as OpenAPI components."""
    schema = model.model_json_schema(ref_template=REFERENCE)
    parts: dict[str, Any] = schema.pop("$defs", {})
    return parts | {model.__name__: schema}


def campaign_schemas() -> dict[str, Any]:
    """Returns JSON schemas of both kinds of campaign, as OpenAPI components."""
    schemas = input_schemas(CampaignSpec)
    plain, ground = schemas[CampaignSpec.__name__], input_schemas(CampaignPlaces)[CampaignPlaces.__name__]
    reference = f"{REFERENCE}/properties/{{name}}"
    fields = {
        name: {"$ref": reference.format(model=CampaignSpec.__name__, name=name)}
        for name in plain["properties"]
        if name != "families"
    }
    schemas[ON_MAP] = plain | {
        "title": ON_MAP,
        "description": "A pattern at places of an uploaded network × methods × seeds on one equal budget.",
        "properties": ground["properties"] | fields,
        "required": ground["required"],
    }
    return schemas
