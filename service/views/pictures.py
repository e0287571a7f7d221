"""Pictures of contacts: drawn when they are asked for, few at once, the newest kept."""

import hashlib
from dataclasses import dataclass, field

import anyio
from anyio import to_thread
from async_lru import alru_cache

from risk_sac import __version__
from risk_sac.config import FamilyName
from risk_sac.failures.recording import Recording
from risk_sac.run_folder.results import Contact
from service.errors import ServiceError
from service.settings import ServiceSettings
from service.store.stored import StoredCampaign, StoredEpisode
from service.views.bodies import series_file
from service.views.series import load_arrays

AT_ONCE = 1  # drawn at a time: matplotlib draws one after the other anyway
MOST_WAITING = 16  # pictures that wait to be drawn
KEPT = 64  # pictures, each of about 150 kB


class TooManyWaiting(ServiceError):
    """Asking for the picture again pays once others have theirs."""


@dataclass(frozen=True, slots=True)
class Subject:
    """What a picture shows; two with the same edition are the same picture."""

    edition: str  # changes whenever the picture would
    campaign_id: str = field(compare=False)
    family: FamilyName = field(compare=False)
    episode: StoredEpisode = field(compare=False)

    @classmethod
    def of(cls, campaign: StoredCampaign, episode: StoredEpisode) -> "Subject":
        """A contact of a campaign."""
        family = next(run.family for run in campaign.runs if run.id == episode.run_id)
        parts = (__version__, campaign.id, episode.id, str(episode.series_sha256), episode.record.model_dump_json())
        edition = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]
        return cls(edition, campaign.id, family, episode)


class Pictures:
    """Draws contacts in threads of its own, so that pictures hold up nothing else that the service does."""

    def __init__(self, settings: ServiceSettings) -> None:
        self._settings = settings
        self._threads = anyio.CapacityLimiter(AT_ONCE)
        self._begun = 0  # pictures that are being drawn, or wait
        self._drawn = alru_cache(maxsize=KEPT)(self._draw)  # who asks for one that is being drawn waits for it

    async def png(self, subject: Subject) -> bytes:
        """The picture of a contact.

        Raises:
          StorageError: its time series is lost.
          TooManyWaiting: for theirs.
        """
        return await self._drawn(subject)

    async def _draw(self, subject: Subject) -> bytes:
        if self._begun >= AT_ONCE + MOST_WAITING:
            raise TooManyWaiting(f"{MOST_WAITING} pictures wait to be drawn; wanted fewer")
        self._begun += 1
        try:
            return await to_thread.run_sync(self._draw_now, subject, limiter=self._threads)
        finally:
            self._begun -= 1

    def _draw_now(self, subject: Subject) -> bytes:
        from risk_sac.failures.show import recording_bytes  # here, because it loads matplotlib

        episode = subject.episode
        path, sha256 = series_file(subject.campaign_id, episode, self._settings)
        arrays = load_arrays(path, sha256)
        contact = Contact(id=episode.id, series=path.name, episode=episode.record)
        return recording_bytes(subject.family, Recording(contact, arrays), "png")
