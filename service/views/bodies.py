"""Stored records as they are answered."""

from pathlib import Path

from risk_sac.records import Campaign, CampaignSummary, Failure, Triage
from risk_sac.run_folder.results import FAILURES
from service.errors import SeriesLost
from service.settings import ServiceSettings
from service.store.stored import StoredCampaign, StoredContact
from service.views.progress import progress
from service.views.series import load_series


def campaign_body(campaign: StoredCampaign, workers: int) -> Campaign:
    """A campaign in full; `workers` as `progress` has it."""
    return Campaign(**dict(summary_body(campaign, workers)), runs=campaign.runs, spec=campaign.spec)


def summary_body(campaign: StoredCampaign, workers: int) -> CampaignSummary:
    """A campaign in a list; `workers` as `progress` has it."""
    stored = {name: getattr(campaign, name) for name in CampaignSummary.model_fields.keys() - {"progress"}}
    return CampaignSummary(**stored, progress=progress(campaign, workers))


def failure_body(campaign_id: str, contact: StoredContact, triage: Triage | None, settings: ServiceSettings) -> Failure:
    """A contact with its time series, or with why there is none, and with its triage."""
    series, problem = None, None
    try:
        series = load_series(*series_file(campaign_id, contact, settings))
    except SeriesLost as error:
        problem = str(error)
    return Failure(**dict(contact.episode), series=series, series_problem=problem, triage=triage)


def series_file(campaign_id: str, contact: StoredContact, settings: ServiceSettings) -> tuple[Path, str | None]:
    """Path and SHA-256 of a contact's time series; SeriesLost if none was recorded."""
    if contact.series is None:
        raise SeriesLost("no time series was recorded")
    folder = settings.run_folder(campaign_id, contact.episode.run_id) / FAILURES
    return folder / contact.series, contact.series_sha256
