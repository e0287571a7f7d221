"""What all bodies share. Numbers that are not finite are null: JSON has no other word for them."""

import math
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict


def _null_unless_finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


Real = Annotated[float | None, BeforeValidator(_null_unless_finite)]


class Body(BaseModel):
    """What all responses share."""

    model_config = ConfigDict(frozen=True, from_attributes=True, use_attribute_docstrings=True)
