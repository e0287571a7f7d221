"""The posted campaign."""

from typing import Annotated

from fastapi import Depends, Request

from risk_sac.config import CampaignSpec
from service.api.answers.problems import invalid_field
from service.api.posted import read_posted


async def _posted(request: Request) -> CampaignSpec:
    spec = await read_posted(request, CampaignSpec)
    if "\0" in spec.label:  # which PostgreSQL does not take
        raise invalid_field("label", spec.label, "text without NUL")
    return spec


PostedCampaign = Annotated[CampaignSpec, Depends(_posted)]
