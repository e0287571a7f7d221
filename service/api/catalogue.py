"""What can be posted, and whether the service works."""

from fastapi import APIRouter, HTTPException

from risk_sac.config import METHODS
from risk_sac.scenario.families import FAMILIES
from service.api.context import Service
from service.api.responses import STOPPED
from service.schemas import Families, Family, Health, Methods, NamedMethod, SceneParameter

router = APIRouter(tags=["catalogue"])


@router.get("/v1/families")
def list_families() -> Families:
    """Scenario families with their scene spaces and default operational design domains."""
    items = [
        Family(
            name=family.name,
            summary=family.summary,
            horizon_steps=family.horizon_steps,
            parameters=[SceneParameter.model_validate(parameter) for parameter in family.space.parameters],
            adversaries=list(family.adversaries),
            odd=family.odd,
        )
        for family in FAMILIES.values()
    ]
    return Families(items=items)


@router.get("/v1/methods")
def list_methods() -> Methods:
    """Search methods as rows of a table."""
    return Methods(items=[NamedMethod(name=name, **dict(method)) for name, method in METHODS.items()])


@router.get("/healthz", responses=STOPPED)
def get_health(service: Service) -> Health:
    """Whether the service answers and campaigns make progress."""
    if not service.manager.alive:
        raise HTTPException(503, "the manager has stopped; the log has the reason")
    return Health()
