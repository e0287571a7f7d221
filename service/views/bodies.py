"""Records as response bodies."""

from pathlib import Path
from typing import Any

from risk_sac.records import Outcome
from risk_sac.run_folder.results import FAILURES
from service.errors import StorageError
from service.schemas import Campaign, CampaignSummary, Episode, Failure, Run, StateChange
from service.settings import ServiceSettings
from service.store.stored import StoredCampaign, StoredChange, StoredEpisode
from service.views.progress import progress
from service.views.series import load_series


def campaign_body(campaign: StoredCampaign, settings: ServiceSettings) -> Campaign:
    """A campaign in full."""
    return Campaign(
        **dict(summary_body(campaign, settings)),
        runs=[Run.model_validate(run) for run in campaign.runs],
        spec=campaign.spec,
    )


def summary_body(campaign: StoredCampaign, settings: ServiceSettings) -> CampaignSummary:
    """A campaign in a list."""
    return CampaignSummary.model_validate(
        {
            "id": campaign.id,
            "label": campaign.label,
            "state": campaign.state,
            "reason": campaign.reason,
            "created_at": campaign.created_at,
            "started_at": campaign.started_at,
            "finished_at": campaign.finished_at,
            "progress": progress(campaign, settings.max_workers),
        }
    )


def episode_body(episode: StoredEpisode) -> Episode:
    """An episode in a list."""
    return Episode.model_validate(_fields(episode))


def failure_body(campaign_id: str, episode: StoredEpisode, settings: ServiceSettings) -> Failure:
    """A contact with its time series, or with the reason why there is none."""
    body = _fields(episode)
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


def change_body(change: StoredChange) -> StateChange:
    """A change of state in a stream of events."""
    return StateChange.model_validate(change)


def tier_outcomes(tier: str) -> tuple[Outcome, ...]:
    """Outcomes that a tier of failures admits: `valid`, or `raw` for all contacts."""
    return (Outcome.FAILURE,) if tier == "valid" else (Outcome.FAILURE, Outcome.DEGENERATE)


def _fields(episode: StoredEpisode) -> dict[str, Any]:
    added = {name: getattr(episode, name) for name in ("id", "run_id", "wall_s", "funnel")}
    return episode.record.model_dump() | added
