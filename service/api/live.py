"""Status and results of campaigns for those who poll them: rendered once for each revision, however many ask."""

from dataclasses import dataclass

from starlette.concurrency import run_in_threadpool

from risk_sac import __version__
from service.api.answers.representations import Representation, caching, entity_tag
from service.api.renderings import Renderings
from service.schemas import Body
from service.settings import ServiceSettings
from service.store.reading import Store
from service.store.records import StoredCampaign
from service.views.bodies import campaign_body
from service.views.progress import retry_after_s
from service.views.totals import results


@dataclass(frozen=True, slots=True)
class Rendered(Representation):
    """What a campaign looked like in one revision."""

    revision: str


class Live:
    """Representations of what changes while it is watched.

    A revision names all that they depend on, but for the settings and the version, which are part of the tag. The store
    knows revisions by heart, so an answer that was given before needs neither the database nor a thread.
    """

    def __init__(self, store: Store, settings: ServiceSettings) -> None:
        self._store = store
        self._settings = settings
        self._edition = f"{__version__}-{settings.max_workers}"
        self._campaigns = Renderings(self._campaign)
        self._results = Renderings(self._found)

    async def campaign(self, campaign_id: str, project: str | None) -> Rendered:
        """State, progress and runs.

        Raises:
          NotFoundError: there is no such campaign.
          StorageError: it cannot be read.
        """
        return await self._campaigns.get(campaign_id, await self.revision(campaign_id, project))

    async def results(self, campaign_id: str, project: str | None) -> Rendered:
        """What it has found.

        Raises:
          NotFoundError: there is no such campaign.
          StorageError: it cannot be read.
        """
        return await self._results.get(campaign_id, await self.revision(campaign_id, project))

    async def revision(self, campaign_id: str, project: str | None) -> str:
        """The store's, in a thread only where the database must be asked.

        Raises:
          NotFoundError: there is no such campaign.
          StorageError: it cannot be read.
        """
        known = self._store.known_revision(campaign_id, project)
        return known if known is not None else await run_in_threadpool(self._store.revision, campaign_id, project)

    def expire(self, campaign_id: str) -> None:
        """Show at once what has just happened to a campaign, such as its end."""
        self._campaigns.expire(campaign_id)
        self._results.expire(campaign_id)

    def _campaign(self, campaign_id: str) -> Rendered:
        campaign = self._store.campaign(campaign_id)
        return self._rendered(campaign, campaign_body(campaign, self._settings))

    def _found(self, campaign_id: str) -> Rendered:
        campaign = self._store.campaign(campaign_id)
        return self._rendered(campaign, results(campaign))

    def _rendered(self, campaign: StoredCampaign, body: Body) -> Rendered:
        # The revision that was read, which may be newer than the one that was asked for.
        tag = entity_tag(campaign.revision, self._edition)
        headers = caching(tag) | waiting(campaign, self._settings)
        return Rendered(body.model_dump_json().encode(), tag, headers, campaign.revision)


def waiting(campaign: StoredCampaign, settings: ServiceSettings) -> dict[str, str]:
    """The header that says when to look again; none once the campaign has ended."""
    wait_s = retry_after_s(campaign, settings.max_workers)
    return {} if wait_s is None else {"Retry-After": str(wait_s)}
