"""Which contacts are asked for."""

from typing import Annotated, Literal

from fastapi import Query

from risk_sac.records import Outcome

TIERS = {"valid": (Outcome.FAILURE,), "raw": (Outcome.FAILURE, Outcome.DEGENERATE)}
Tier = Annotated[Literal["valid", "raw"], Query(description="`raw` adds contacts that a rule refused.")]
