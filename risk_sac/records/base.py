"""Base of all records; writes and reads numbers that are not finite."""

import math
from typing import Annotated, Any, Generic, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, WithJsonSchema
from pydantic_core import to_json

from risk_sac.world.documented import Documented


def _without_defaults(schema: dict[str, Any]) -> None:
    """Drops defaults from a schema: they are for records of older versions."""
    for each in schema.get("properties", {}).values():
        each.pop("default", None)


class Record(Documented):
    """Frozen model, stored as JSON, answered by the service, read by clients.

    Stored JSON, in a run's folder and in the database, has a non-finite number as the string "Infinity", "-Infinity" or
    "NaN". So it reads back. `wire` writes null instead.
    """

    model_config = ConfigDict(
        ser_json_inf_nan="strings",
        serialize_by_alias=True,
        json_schema_extra=_without_defaults,
        json_schema_serialization_defaults_required=True,
    )


def stored(value: object) -> str:
    """JSON as it is stored; it reads back as it was."""
    return to_json(value, inf_nan_mode="strings").decode()


def wire(record: BaseModel) -> bytes:
    """Returns JSON as the service answers, with null for non-finite numbers."""
    return to_json(record.model_dump(), inf_nan_mode="null")


_NULLABLE = WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "null"}]})
Real = Annotated[float, BeforeValidator(lambda value: math.nan if value is None else value), _NULLABLE]
"""A number; null on the wire where it is not finite."""
Least = Annotated[float, BeforeValidator(lambda value: math.inf if value is None else value), _NULLABLE]
"""The least of some values, infinite without any; null on the wire."""

T = TypeVar("T")


class Page(Record, Generic[T]):
    """A part of a list."""

    items: list[T]
    next: str | None
    """Pass as `cursor` to continue; null at the end."""


class Adjustment(Record):
    """A setting that episodes use otherwise than it was asked for."""

    families: tuple[str, ...]
    """Where that is so."""
    field: str
    """Dotted path, such as `odd.environment.visibility_m`."""
    asked: str
    used: str
    why: str

    def __str__(self) -> str:
        where = f" in {', '.join(self.families)}"
        return f"{self.field}: asked for {self.asked}, used {self.used}{where}; {self.why}"


class FieldProblem(Record):
    """Error in one field of an input."""

    field: str
    """Dotted path as it was written, such as `budget.episodes`."""
    message: str
    got: str
    """The offending value as JSON, shortened."""
    wanted: str
