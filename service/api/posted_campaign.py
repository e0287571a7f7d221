"""The posted campaign, read strictly: `"3"` and `true` are no numbers, as the API's description says."""

import json
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import Depends, HTTPException, Request
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError

from risk_sac.config import CampaignSpec
from service.api.answers.problems import ProblemError, invalid_field
from service.schemas.problems import Reason

MOST_MISTAKES = 50  # that a refusal names one by one

_REFERENCE = "#/components/schemas/{model}-Input"

DOCUMENTED_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {"application/json": {"schema": {"$ref": _REFERENCE.format(model="CampaignSpec")}}},
    }
}


def body_schemas() -> dict[str, Any]:
    """JSON schemas of the body and its parts, as components of the API's description."""
    schema = CampaignSpec.model_json_schema(ref_template=_REFERENCE)
    parts = schema.pop("$defs") | {"CampaignSpec": schema}
    return {f"{name}-Input": part for name, part in parts.items()}


async def _posted(request: Request) -> CampaignSpec:
    # Not a body parameter: FastAPI validates the parsed JSON, where strictness would refuse arrays for tuples.
    if request.headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
        raise HTTPException(415, f"content-type is {request.headers.get('content-type')!r}; wanted application/json")
    content = await request.body()
    try:
        spec = CampaignSpec.model_validate_json(content, strict=True)
    except ValidationError as error:
        if error.error_count() > MOST_MISTAKES:  # naming a million of them would keep the server busy for minutes
            detail = f"the body has {error.error_count()} mistakes; wanted none. Up to {MOST_MISTAKES} would be named"
            raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, Reason.INVALID_FIELD, detail) from error
        raise RequestValidationError([item | {"loc": ("body", *item["loc"])} for item in error.errors()]) from error
    json.loads(content, object_pairs_hook=_without_repeats)
    if "\0" in spec.label:  # which PostgreSQL does not take
        raise invalid_field("label", spec.label, "text without NUL")
    return spec


def _without_repeats(pairs: list[tuple[str, Any]]) -> None:
    """Refuse an object that has a field twice: of the two, readers differ in which one counts."""
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:  # no object of a campaign that passed has many fields
            detail = f"the body has the field {name!r} twice in one object; wanted it once"
            raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, Reason.INVALID_FIELD, detail)


PostedCampaign = Annotated[CampaignSpec, Depends(_posted)]
