"""The names of requirements that a filter takes and that metrics are labelled with."""

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
    """The requirement asked for; a 422 that names the campaign's unless it has this one."""
    if requirement is None:
        return None
    known = dict.fromkeys([*SHIPPED_REQUIREMENTS, *service.store.own_requirements(campaign_id, caller.sees)])
    if requirement not in known:
        raise invalid_field("requirement", requirement, f"one of: {', '.join(known)}")
    return requirement


AskedRequirement = Annotated[str | None, Depends(_known)]
