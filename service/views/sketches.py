"""What is shown of a contact at once: the ground that it came about on, and a small drawing."""

from risk_sac.failures.roads import roads_of
from risk_sac.failures.thumbnail import thumbnail
from service.schemas.failures import Roads, Surface
from service.settings import ServiceSettings
from service.views.pictures import ContactOfARun, recording_of

MM = 3  # decimals of a metre


def roads_body(contact: ContactOfARun) -> Roads:
    """The surfaces of a contact's scene."""
    surfaces = roads_of(contact.run.family, contact.episode.scene)
    return Roads(
        surfaces=[Surface(use=surface.use, outline=surface.outline.round(MM).tolist()) for surface in surfaces]
    )


def thumbnail_of(contact: ContactOfARun, settings: ServiceSettings) -> str:
    """A contact as a small SVG.

    Raises:
      StorageError: its time series is lost.
    """
    roads = roads_of(contact.run.family, contact.episode.scene)
    return thumbnail(recording_of(contact, settings), roads)
