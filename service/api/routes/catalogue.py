"""What can be posted."""

from dataclasses import asdict

from fastapi import APIRouter

from risk_sac.config import METHODS, EgoConfig
from risk_sac.egos.registry import cards
from risk_sac.failures.export.formats import FORMATS
from risk_sac.risk.signals import SIGNALS
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.odd import requirements_from_odd, widest
from service.schemas.catalogue import (
    Ego,
    Egos,
    ExportFormat,
    ExportFormats,
    Families,
    Family,
    Methods,
    NamedMethod,
    SceneParameter,
    Signal,
)

PROFILES = {
    "default": "SUMO's default driver, with a driver's delay and a driver's view.",
    "perfect": "The same, that reacts within a step and sees everything.",
    "careful": "The default, with the braking of UN R157's careful driver on top.",
}
router = APIRouter(prefix="/v1", tags=["catalogue"])


@router.get("/families")
def list_families() -> Families:
    """Scenario families with scene space, default ODD and requirements, and the signals that formulas speak of."""
    items = [
        Family(
            name=family.name,
            summary=family.summary,
            horizon_steps=family.horizon_steps,
            parameters=[
                SceneParameter.model_validate(parameter, from_attributes=True) for parameter in family.space.parameters
            ],
            adversaries=list(family.adversaries),
            odd=family.odd,
            odd_limits=widest(family.odd),
            requirements=list(requirements_from_odd(family.odd, EgoConfig().response_s)),
        )
        for family in FAMILIES.values()
    ]
    signals = [Signal(name=name, **asdict(signal)) for name, signal in SIGNALS.items()]
    return Families(items=items, signals=signals)


@router.get("/formats")
def list_formats() -> ExportFormats:
    """Formats that failures and episodes can be exported in."""
    items = [
        ExportFormat(
            name=name,
            title=row.title,
            what=row.what,
            of=row.of,
            suffix=row.suffix,
            media_type=row.media_type,
            missing=list(row.missing),
        )
        for name, row in FORMATS.items()
    ]
    return ExportFormats(items=items)


@router.get("/egos")
def list_egos() -> Egos:
    """Who can drive: SUMO's models by profile, and the egos that the operator has registered."""
    models = [
        Ego(
            name=name,
            kind="sumo",
            version=None,
            response_time_s=EgoConfig.model_validate({"profile": name}).response_s,
            deadline_s=None,
            summary=summary,
        )
        for name, summary in PROFILES.items()
    ]
    return Egos(items=[*models, *(Ego.model_validate(card, from_attributes=True) for card in cards())])


@router.get("/methods")
def list_methods() -> Methods:
    """Search methods as rows of a table."""
    return Methods(items=[NamedMethod(name=name, **dict(method)) for name, method in METHODS.items()])
