"""Posted JSON, read strictly: `"3"` and `true` are no numbers, as the API's description says."""

import json
from collections.abc import Collection
from http import HTTPStatus
from typing import Any, TypeVar

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ValidationError

from service.api.answers.problems import ProblemError, Reason

MOST_MISTAKES = 50  # that a refusal names one by one
REFERENCE = "#/components/schemas/{model}"

Model = TypeVar("Model", bound=BaseModel)


async def read_posted(request: Request, model: type[Model]) -> Model:
    """Reads the body of a request.

    Not a body parameter: FastAPI validates the parsed JSON, where strictness would refuse arrays for tuples.
    """
    media_type(request, ["application/json"])
    return read_content(await request.body(), model)


def read_content(content: bytes, model: type[Model]) -> Model:
    """The content of a body; raises what `read_posted` does."""
    try:
        posted = model.model_validate_json(content, strict=True)
    except ValidationError as error:
        if error.error_count() > MOST_MISTAKES:  # naming a million of them would keep the server busy for minutes
            detail = f"the body has {error.error_count()} mistakes; wanted none. Up to {MOST_MISTAKES} would be named"
            raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, Reason.INVALID_FIELD, detail) from error
        found = [item | {"loc": ("body", *item["loc"])} for item in error.errors()]
        raise RequestValidationError(found, body=model) from error  # the model: it knows which fields there are
    refuse_repeats(content)
    return posted


def refuse_repeats(content: bytes) -> None:
    """Refuses JSON that has a field twice in one object."""
    json.loads(content, object_pairs_hook=_without_repeats)


def documented(model: type[BaseModel]) -> dict[str, Any]:
    """How a route says that it takes such a body."""
    schema = {"$ref": REFERENCE.format(model=model.__name__)}
    return {"requestBody": {"required": True, "content": {"application/json": {"schema": schema}}}}


def input_schemas(model: type[BaseModel]) -> dict[str, Any]:
    """JSON schemas of the body and its parts, as components of the API's description."""
    schema = model.model_json_schema(ref_template=REFERENCE)
    parts: dict[str, Any] = schema.pop("$defs", {})
    return parts | {model.__name__: schema}


def _without_repeats(pairs: list[tuple[str, Any]]) -> None:
    """Refuses an object that has a field twice: of the two, readers differ in which one counts."""
    seen = set[str]()
    for name, _ in pairs:
        if name in seen:
            detail = f"the body has the field {name!r} twice in one object; wanted it once"
            raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, Reason.INVALID_FIELD, detail)
        seen.add(name)


def media_type(request: Request, wanted: Collection[str]) -> str:
    """Returns the media type of a body; raises a 415 unless it is wanted, and one for a packed body."""
    given = request.headers.get("content-type", "")
    declared = given.partition(";")[0].strip().lower()
    if declared not in wanted:
        example = f"curl -H 'content-type: {next(iter(wanted))}' --data-binary @FILE"
        detail = (
            f"content-type is {given[:100]!r}; wanted {' or '.join(wanted)}: send the file alone, as in `{example}`"
        )
        raise _unsupported(detail)
    encoding = request.headers.get("content-encoding", "identity")
    if encoding.strip().lower() != "identity":
        raise _unsupported(f"content-encoding is {encoding[:100]!r}; wanted none: send the body as it is")
    return declared


def _unsupported(detail: str) -> ProblemError:
    return ProblemError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, Reason.UNSUPPORTED_MEDIA_TYPE, detail)
