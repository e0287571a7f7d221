"""Converts a validation's findings into errors of fields."""

import json
import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from pydantic import BaseModel, ValidationError

from risk_sac.errors import ConfigError, did_you_mean

LONGEST_VALUE = 200
_EXPECTED = {
    "greater_than": "> {gt}",
    "greater_than_equal": ">= {ge}",
    "less_than": "< {lt}",
    "less_than_equal": "<= {le}",
    "literal_error": "{expected}",
    "enum": "{expected}",
    "string_pattern_mismatch": "a string matching {pattern}",
    "string_too_short": "at least {min_length} characters",
    "string_too_long": "at most {max_length} characters",
    "too_short": "at least {min_length} entries",
    "too_long": "at most {max_length} entries",
    "missing": "a value",
    "finite_number": "a finite number",
    "float_type": "a number",
    "int_type": "an integer",
    "model_type": "a JSON object",
    "tuple_type": "a JSON array",
}

Location = tuple[int | str, ...]


UNKNOWN_FIELD = "extra_forbidden"


def field_errors(error: ValidationError, model: type[BaseModel]) -> ConfigError:
    """Returns the first wrong field, with the others in `others`.

    Unknown names come first: a misspelt one leaves another missing.
    """
    found = sorted(causes(error.errors()), key=lambda item: item["type"] != UNKNOWN_FIELD)
    first, *others = (field_error(item, model) for item in found)
    first.others = tuple(others)
    return first


def causes(found: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Drops errors that repeat one inside them: a list is "too short" once its bad entries are dropped."""
    locations = [item["loc"] for item in found]

    def repeats(location: Location) -> bool:
        return any(len(other) > len(location) and other[: len(location)] == location for other in locations)

    return [item for item in found if not repeats(item["loc"])]


def field_error(item: Mapping[str, Any], model: type[BaseModel] | None = None) -> ConfigError:
    """Translates one of `ValidationError.errors()`; fields of `model` are listed where one is unknown."""
    location: Location = item["loc"]
    field = dotted(location)
    cause = item.get("ctx", {}).get("error")
    if isinstance(cause, ConfigError):
        return ConfigError(f"{field}.{cause.field}".strip("."), cause.got, cause.expected, cause.remedy)
    got = "nothing" if item["type"] == "missing" else shown(item.get("input"))
    if item["type"] == UNKNOWN_FIELD and model is not None:
        known = _fields_at(location[:-1], model)
        return ConfigError(field, got, f"one of {', '.join(known)}", did_you_mean(str(location[-1]), known))
    template = _EXPECTED.get(item["type"])
    if template:
        expected = template.format(**item.get("ctx", {}))
        choices = re.findall(r"'([^']+)'", expected) if item["type"] in ("literal_error", "enum") else []
        return ConfigError(field, got, expected, did_you_mean(str(item.get("input")), choices))
    return ConfigError(field, got, str(item["msg"]).removeprefix("Input should be ").partition(",")[0])


def dotted(location: Location) -> str:
    """A location as a path: `requirements[0].name`."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).removeprefix(".")


def shown(value: object) -> str:
    """A value as JSON, shortened."""
    text = json.dumps(value, default=str)  # ASCII, so that lone surrogates survive
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}…"


def _fields_at(location: Location, model: type[BaseModel]) -> list[str]:
    """Names of the fields at a location of a model's JSON schema."""
    schema = _schema(model)
    node = schema
    for part in location:
        node = _resolve(schema, node)
        node = node["properties"][part] if isinstance(part, str) else node["items"]
    return sorted(_resolve(schema, node)["properties"])


@cache
def _schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema()


def _resolve(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    node = next((option for option in node.get("anyOf", []) if option.get("type") != "null"), node)
    reference: str | None = node.get("$ref")
    return node if reference is None else schema["$defs"][reference.rpartition("/")[2]]
