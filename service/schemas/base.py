"""What all bodies share."""

from typing import Any

from pydantic import BaseModel, ConfigDict

Real = float | None  # null where it is not finite: JSON has no other word for that


class Body(BaseModel):
    """What all responses share."""

    model_config = ConfigDict(frozen=True, from_attributes=True, use_attribute_docstrings=True, ser_json_inf_nan="null")


def _without_defaults(schema: dict[str, Any]) -> None:
    for each in schema["properties"].values():
        each.pop("default", None)


class Shown(Body):
    """A record of the method in public: `class Metrics(RunMetrics, Shown)`; the rules of the last one win.

    Its defaults are for what was stored before there was the field; a response has every field.
    """

    model_config = ConfigDict(json_schema_extra=_without_defaults, json_schema_serialization_defaults_required=True)
