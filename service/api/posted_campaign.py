"""The posted campaign: of families, or of places of an uploaded network, which become families here."""

import json
from typing import Annotated, Any, Literal, Self

from fastapi import Depends, Request
from fastapi.concurrency import run_in_threadpool
from pydantic import Field, model_validator

from risk_sac.config import CampaignSpec, Settings
from risk_sac.errors import ConfigError
from risk_sac.scenario.maps.found import Pattern
from service.api.answers.problems import invalid_field
from service.api.context import Caller, Context, CurrentCaller, Service
from service.api.posted import REFERENCE, input_schemas, media_type, read_content, refuse_repeats
from service.errors import NotFoundError

ON_MAP = "CampaignOnMap"


class Ground(Settings):
    """Where on a network a campaign is run."""

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


async def _posted(request: Request, service: Service, caller: CurrentCaller) -> CampaignSpec:
    media_type(request, ["application/json"])
    content = await request.body()
    on_map = _on_map(content)
    if on_map is not None:
        refuse_repeats(content)
        ground, rest = on_map
        asked = read_content(json.dumps(ground).encode(), Ground)
        families = await run_in_threadpool(_families, asked, service, caller)
        content = json.dumps({"families": families} | rest).encode()
    spec = read_content(content, CampaignSpec)
    if "\0" in spec.label:  # which PostgreSQL does not take
        raise invalid_field("label", spec.label, "text without NUL")
    return spec


PostedCampaign = Annotated[CampaignSpec, Depends(_posted)]


def documented_campaign() -> dict[str, Any]:
    """How a route says that it takes a campaign of either kind."""
    either = [{"$ref": REFERENCE.format(model=name)} for name in (CampaignSpec.__name__, ON_MAP)]
    return {"requestBody": {"required": True, "content": {"application/json": {"schema": {"anyOf": either}}}}}


def campaign_schemas() -> dict[str, Any]:
    """JSON schemas of both kinds, as components of the API's description."""
    schemas = input_schemas(CampaignSpec)
    plain, ground = schemas[CampaignSpec.__name__], input_schemas(Ground)[Ground.__name__]
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


def _on_map(content: bytes) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """The fields that say where, and the others, of a campaign on a network; None of any other body."""
    try:
        posted = json.loads(content)
    except (ValueError, RecursionError):
        return None  # what is wrong with it is said by whoever reads it strictly
    if not isinstance(posted, dict) or "network" not in posted:
        return None
    if "families" in posted:
        raise invalid_field("families", posted["families"], "either families or a network with its places, not both")
    names = Ground.model_fields.keys()
    return {k: v for k, v in posted.items() if k in names}, {k: v for k, v in posted.items() if k not in names}


def _families(ground: Ground, service: Context, caller: Caller) -> list[str]:
    try:
        return service.surveys.keep(ground.network, caller.sees, ground.pattern, ground.place)
    except NotFoundError as error:
        raise invalid_field("network", ground.network, "the id of one of GET /v1/networks") from error
