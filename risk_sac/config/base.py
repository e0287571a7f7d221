"""Base of all settings."""

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from risk_sac.errors import ConfigError


class Settings(BaseModel):
    """Frozen, closed to unknown fields, and finite.

    Every number has bounds, far beyond what is of use and short of where arithmetic ends: between them, a run's figures
    stay finite.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)


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
