"""Settings of a search for an ego's boundary between passing and failing."""

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from risk_sac.config.base import Settings, Word
from risk_sac.errors import ConfigError

ParameterName = Annotated[str, StringConstraints(min_length=1, max_length=200)]


class BoundaryConfig(Settings):
    """Parameters over which the method `boundary` searches, and what failing means."""

    over: Annotated[tuple[ParameterName, ...], Field(min_length=2, max_length=4)]
    """Scene parameters with a range. The picture's axes are the first two."""
    others: Literal["fixed", "drawn"] = "fixed"
    """fixed: each other parameter has its median. drawn: it is drawn from its distribution, so the boundary is where
    half of the scenes fail."""
    at: Annotated[Mapping[ParameterName, float | Word], Field(max_length=100)] = {}
    """Other parameter → number or word that it has in all scenes."""
    requirement: Annotated[str, Field(max_length=40)] = ""
    """The one whose violation is failing; by default a contact, or a violation of any requirement that counts."""

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        if len(set(self.over)) < len(self.over):
            raise ConfigError("over", ", ".join(self.over), "each parameter once")
        if twice := [name for name in self.over if name in self.at]:
            raise ConfigError(f"at.{twice[0]}", "a parameter of `over`", "another one")
        return self
