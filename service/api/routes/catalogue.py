"""What can be posted."""

from fastapi import APIRouter

from risk_sac.config import METHODS
from risk_sac.scenario.families import FAMILIES
from service.schemas.catalogue import Families, Family, Methods, NamedMethod, SceneParameter

router = APIRouter(prefix="/v1", tags=["catalogue"])


@router.get("/families")
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


@router.get("/methods")
def list_methods() -> Methods:
    """Search methods as rows of a table."""
    return Methods(items=[NamedMethod(name=name, **dict(method)) for name, method in METHODS.items()])
