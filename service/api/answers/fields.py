"""Which field of a request is wrong, what it held and what it should hold, from what the validation found."""

import json
import re
from collections.abc import Sequence
from functools import cache
from typing import Any

from pydantic import BaseModel

from service.schemas.problems import FieldProblem

LONGEST_VALUE = 200
# How this project words an error: "reaction_time_s is 0.55; wanted a multiple of 0.1", or where the
# field goes without saying: "column 3: got 'x', wanted a signal".
_HOUSE_STYLES = (
    re.compile(r"(?P<field>[\w.]+) (?:is|are named) (?P<got>.+?); (?:wanted )?(?P<wanted>.+)", re.DOTALL),
    re.compile(r"(?P<field>).*?\bgot (?P<got>.+?)[,;] wanted (?P<wanted>.+)", re.DOTALL),
)
_LIMITS = {
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


def field_problems(found: Sequence[dict[str, Any]], model: type[BaseModel] | None) -> list[FieldProblem]:
    """One for each cause among the errors of a validation.

    Args:
      found: the errors.
      model: what the body was to be; None where only what comes without a body was validated.
    """
    locations = [item["loc"] for item in found]
    return [_field_problem(item, model) for item in found if not _follows(item["loc"], locations)]


def _follows(location: Location, others: Sequence[Location]) -> bool:
    """Whether an error only repeats one inside it: a list "too short" once its bad entries are dropped."""
    return any(len(other) > len(location) and other[: len(location)] == location for other in others)


def _field_problem(item: dict[str, Any], model: type[BaseModel] | None) -> FieldProblem:
    location: Location = item["loc"]
    path = _dotted(location)
    message = str(item["msg"]).removeprefix("Value error, ")
    got = "nothing" if item["type"] == "missing" else shown(item.get("input"))
    wanted = _wanted(item, location, model)
    if item["type"] == "value_error":
        field, stated, wanted = parse(message)
        path = f"{path}.{field}".strip(".")
        got = stated or got
    return FieldProblem(field=_ascii(path), message=message, got=got, wanted=wanted)


def _dotted(location: Location) -> str:
    """`requirements[0].name`, without the part that says where in the request it was."""
    parts = location[1:] if location[0] in ("body", "query", "path", "header") else location
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts).removeprefix(".")


def _wanted(item: dict[str, Any], location: Location, model: type[BaseModel] | None) -> str:
    if item["type"] == "extra_forbidden" and model is not None:
        return f"one of {', '.join(_known_fields(location[1:-1], model))}"
    template = _LIMITS.get(item["type"])
    if template:
        return template.format(**item.get("ctx", {}))
    return str(item["msg"]).removeprefix("Input should be ").partition(",")[0]


def parse(message: str) -> tuple[str, str, str]:
    """Field, got and wanted of a message in house style; the whole message is wanted where it is not."""
    for style in _HOUSE_STYLES:
        if match := style.fullmatch(message):
            return match["field"], match["got"], match["wanted"]
    return "", "", message


def _known_fields(location: Location, model: type[BaseModel]) -> list[str]:
    """Names of the fields that a body has at a location of its JSON schema."""
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


def shown(value: object) -> str:
    """A value as JSON, shortened."""
    return _shortened(json.dumps(value, default=str))  # ASCII, so that lone surrogates survive


def _ascii(text: str) -> str:
    return _shortened(text.encode("ascii", "backslashreplace").decode())


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}…"
