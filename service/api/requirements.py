"""Names of requirements for filters and metric labels."""

from typing import Annotated

from fastapi import Depends, Query

from risk_sac.scenario.odd import SHIPPED_REQUIREMENTS
from service.api.answers.problems import invalid_field
from service.api.context import CurrentCaller, Service


def _known(
    campaign_id: str,
    service: Service,
    caller: CurrentCaller,
    requirement: Annotated[
        str | None,
        Query(
            max_length=40,
            description="Only those that violate it. With `tier=valid` it must count, and the violation be valid.",
        ),
    ] = None,
) -> str | None:
    """Returns the requested requirement; 422 with the campaign's unless it has it."""
    if requirement is None:
        return None
    known = dict.fromkeys([*SHIPPED_REQUIREMENTS, *service.store.own_requirements(campaign_id, caller.sees)])
    if requirement not in known:
        raise invalid_field("requirement", requirement, f"one of: {', '.join(known)}")
    return requirement


AskedRequirement = Annotated[str | None, Depends(_known)]
