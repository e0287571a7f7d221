"""What is drawn of a contact at once: the ground that it came about on."""

from collections.abc import Sequence

from risk_sac.failures.roads import Surface, roads_of
from service.schemas import failures
from service.schemas.failures import Roads
from service.views.pictures import ContactOfARun

MM = 3  # decimals of a metre


def roads_body(contact: ContactOfARun) -> Roads:
    """The surfaces of a contact's scene."""
    return Roads(surfaces=_surfaces(roads_of(contact.run.family, contact.episode.record.scene)))


def _surfaces(surfaces: Sequence[Surface]) -> list[failures.Surface]:
    return [failures.Surface(use=each.use, outline=each.outline.round(MM).tolist()) for each in surfaces]
