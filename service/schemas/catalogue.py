"""What can be posted."""

from risk_sac.config import FamilyName, Method, MethodName, Odd
from service.schemas.base import Body


class SceneParameter(Body):
    """One dimension of a family's scene space."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str


class Family(Body):
    """A scenario family: what is searched, and where."""

    name: FamilyName
    summary: str
    horizon_steps: int
    """Length of an episode in control steps of 0.1 s."""
    parameters: list[SceneParameter]
    adversaries: list[str]
    odd: Odd
    """Default operational design domain; a campaign's own narrows it."""


class Families(Body):
    """All scenario families."""

    items: list[Family]


class NamedMethod(Method):
    """A search method."""

    name: MethodName


class Methods(Body):
    """All search methods."""

    items: list[NamedMethod]
