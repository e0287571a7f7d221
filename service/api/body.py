"""The posted campaign, read strictly: `"3"` and `true` are no numbers, as the API's description says."""

from typing import Annotated, Any

from fastapi import Depends, HTTPException, Request
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError

from risk_sac.config import CampaignSpec

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
    try:
        return CampaignSpec.model_validate_json(await request.body(), strict=True)
    except ValidationError as error:
        raise RequestValidationError([item | {"loc": ("body", *item["loc"])} for item in error.errors()]) from error


PostedCampaign = Annotated[CampaignSpec, Depends(_posted)]
