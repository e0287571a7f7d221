"""Records as response bodies."""

from pathlib import Path
from typing import Any

from risk_sac.run_folder.results import FAILURES
from service.errors import StorageError
from service.schemas.campaigns import Campaign, CampaignSummary, Run
from service.schemas.episodes import Episode
from service.schemas.failures import Failure
from service.settings import ServiceSettings
from service.store.stored import StoredCampaign, StoredEpisode, StoredTriage
from service.views.progress import progress
from service.views.series import load_series


def campaign_body(campaign: StoredCampaign, workers: int) -> Campaign:
    """A campaign in full; `workers` as `progress` has it."""
    return Campaign(
        **dict(summary_body(campaign, workers)),
        runs=[Run.model_validate(run) for run in campaign.runs],
        spec=campaign.spec,
    )


def summary_body(campaign: StoredCampaign, workers: int) -> CampaignSummary:
    """A campaign in a list; `workers` as `progress` has it."""
    stored = {name: getattr(campaign, name) for name in CampaignSummary.model_fields.keys() - {"progress"}}
    return CampaignSummary.model_validate(stored | {"progress": progress(campaign, workers)})


def episode_body(episode: StoredEpisode) -> Episode:
    """An episode in a list."""
    return Episode.model_validate(_fields(episode))


def failure_body(
    campaign_id: str, episode: StoredEpisode, triage: StoredTriage | None, settings: ServiceSettings
) -> Failure:
    """A contact with its time series, or with the reason why there is none, and with what people made of it."""
    body = _fields(episode) | {"triage": triage}
    try:
        body |= {"series": load_series(*series_file(campaign_id, episode, settings)), "series_problem": None}
    except StorageError as error:
        body |= {"series": None, "series_problem": str(error)}
    return Failure.model_validate(body)


def series_file(campaign_id: str, episode: StoredEpisode, settings: ServiceSettings) -> tuple[Path, str | None]:
    """Where a contact's time series lies, and its SHA-256.

    Raises:
      StorageError: none was recorded.
    """
    if episode.series is None:
        raise StorageError("no time series was recorded")
    return settings.run_folder(campaign_id, episode.run_id) / FAILURES / episode.series, episode.series_sha256


def _fields(episode: StoredEpisode) -> dict[str, Any]:
    added = {name: getattr(episode, name) for name in ("id", "run_id", "wall_s", "funnel", "repetition")}
    return episode.record.model_dump() | added
