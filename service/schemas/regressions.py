"""Old failures against another ego."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import Field

from risk_sac.config import EgoConfig
from risk_sac.config.base import Settings
from risk_sac.failures.cases import Case
from service.schemas.base import Body


class PostedRegression(Settings):
    """What to play against what."""

    campaign_id: Annotated[str, Field(max_length=100, pattern=r"^[A-Za-z0-9]+$")]
    """Whose distinct failures; it has ended."""
    ego: EgoConfig
    """The other ego, such as `{"profile": "careful"}`."""


class Regression(Body):
    """The distinct failures of a campaign against another ego."""

    id: str
    campaign_id: str
    ego: EgoConfig
    state: Literal["queued", "running", "succeeded", "failed"]
    reason: str | None
    """Why it failed."""
    created_at: datetime
    finished_at: datetime | None
    passed: bool | None
    """Whether all failures are fixed; null until it has succeeded."""
    cases: list[Case]
    """One for each distinct failure of each run."""
