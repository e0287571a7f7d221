"""Base class of all settings, and readable errors about them."""

import codecs
import json
import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Generic, Self, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError, model_validator

from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.world.documented import Documented


class Settings(Documented):
    """Frozen, closed to unknown fields, and finite.

    Every number has bounds, far beyond what is of use and short of where arithmetic ends: between them, a run's figures
    stay finite.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


T = TypeVar("T")
Word = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,63}$")]


class Chosen(Settings, Generic[T]):
    """A value for each word of a parameter."""

    by: Word
    """Parameter with words, or column of a parameter's rows that has words."""
    of: Annotated[Mapping[Word, T], Field(min_length=1)]
    """Word → value."""


class Interval(Settings):
    """A closed interval [low, high]."""

    low: float
    high: float

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.low > self.high:
            raise ConfigError("low", f"{self.low:g} with high {self.high:g}", "low <= high")
        return self

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high


Fraction = Annotated[float, Field(ge=0, le=1)]
Weight = Annotated[float, Field(ge=0, le=1000)]


def is_none(value: object) -> bool:
    """Whether a setting is omitted when written, which keeps older specs' digests."""
    return value is None


FIELDS = "fields and their values, such as `family: low`"
MARKS = {  # longer marks come first
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF8: "UTF-8-sig",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}


def read_text(file: Path, field: str) -> str:
    """Reads a text file in UTF-8 or its byte order mark's encoding.

    Lines end with a line feed.

    Raises:
      ConfigError: it cannot be read, or is no text; it names the field.
    """
    try:
        content = file.read_bytes()
    except OSError as error:
        got = f"{file}, which cannot be read ({error.strerror})"
        raise ConfigError(field, got, "a text file", "check its path") from error
    encoding = next((name for mark, name in MARKS.items() if content.startswith(mark)), "UTF-8")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        got = f"{file}, which is no {encoding.removesuffix('-sig')} from byte {error.start} on"
        raise ConfigError(field, got, "a text file", "save it as UTF-8") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_fields(file: Path, field: str) -> dict[str, Any]:
    """Read a mapping from a file of YAML or JSON.

    Raises:
      ConfigError: it is neither, or holds something else; it names the field.
    """
    text = read_text(file, field)
    try:
        data = _parsed(text)
    except (yaml.YAMLError, RecursionError) as error:
        raise ConfigError(field, f"{file}, which is no YAML{_place_of(error)}", FIELDS, "mend it there") from error
    if not isinstance(data, dict):
        raise ConfigError(field, f"{file}, which holds a {type(data).__name__}", FIELDS)
    return data


def _place_of(error: Exception) -> str:
    if not isinstance(error, yaml.MarkedYAMLError) or error.problem_mark is None:
        return f": {error or 'it is nested too deep'}"
    mark = error.problem_mark
    return f" from line {mark.line + 1}, column {mark.column + 1} on: {error.problem}"


def _parsed(text: str) -> Any:
    """Parses JSON or YAML; YAML refuses tabs and reads 1e-7 as text."""
    if text.lstrip().startswith("{"):
        try:
            return json.loads(text)
        except ValueError:
            pass  # YAML may begin so, too
    return yaml.safe_load(text)


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
    "union_tag_invalid": "a {discriminator} of {expected_tags}",
    "union_tag_not_found": "a {discriminator}",
}
_CHOSEN = ("literal_error", "enum", "union_tag_invalid")

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


def causes(errors: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Drops errors that contain others: a list without bad entries seems short."""
    locations = [item["loc"] for item in errors]

    def repeats(location: Location) -> bool:
        return any(len(other) > len(location) and other[: len(location)] == location for other in locations)

    return [item for item in errors if not repeats(item["loc"])]


def field_error(item: Mapping[str, Any], model: type[BaseModel] | None = None) -> ConfigError:
    """Translates a pydantic error; lists fields of `model` where one is unknown."""
    location: Location = item["loc"]
    field = dotted(location)
    cause = item.get("ctx", {}).get("error")
    if isinstance(cause, ConfigError):
        return ConfigError(f"{field}.{cause.field}".strip("."), cause.got, cause.expected, cause.remedy)
    got = "nothing" if item["type"] == "missing" else shown(item.get("input"))
    if item["type"] == UNKNOWN_FIELD and model is not None:
        known = _fields_at(location[:-1], model)
        wanted = f"one of {', '.join(known)}" if known else "no field of this name"
        return ConfigError(field, got, wanted, did_you_mean(str(location[-1]), known))
    if item["type"] == "model_type" and model is not None:
        return ConfigError(field, got, f"a JSON object of {', '.join(_fields_at(location, model))}")
    template = _EXPECTED.get(item["type"])
    if template:
        context = item.get("ctx", {})
        expected = template.format(**context)
        named = context.get("expected_tags", expected) if item["type"] in _CHOSEN else ""
        choices = re.findall(r"'([^']+)'", named)
        return ConfigError(field, got, expected, did_you_mean(str(context.get("tag", item.get("input"))), choices))
    return ConfigError(field, got, str(item["msg"]).removeprefix("Input should be ").partition(",")[0])


def dotted(location: Location) -> str:
    """A location as a path: `requirements[0].name`."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).removeprefix(".")


def shown(value: object) -> str:
    """A value as JSON, shortened."""
    text = json.dumps(value, default=str)  # ASCII, so that lone surrogates survive
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}…"


def _fields_at(location: Location, model: type[BaseModel]) -> list[str]:
    schema = _schema(model)
    node = schema
    for part in location:
        node = _resolve(schema, node)
        if isinstance(part, int):
            node = node.get("items", {})
        else:  # a name that the model does not declare is a mapping's key, or says which of several types is meant
            keys = [*node.get("patternProperties", {}).values(), node.get("additionalProperties")]
            node = node.get("properties", {}).get(part) or keys[0] or {}
    return sorted(_resolve(schema, node).get("properties", {}))


@cache
def _schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema()


def _resolve(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    node = next((option for option in node.get("anyOf", []) if option.get("type") != "null"), node)
    reference: str | None = node.get("$ref")
    return node if reference is None else schema["$defs"][reference.rpartition("/")[2]]
