"""Reads an ego's campaigns from the database to compare its versions."""

from collections.abc import Sequence

from risk_sac.errors import ConfigError
from risk_sac.records import State
from risk_sac.report.trend import EndedCampaign, EndedRun, LeftOut, Trend, check_scenarios, driver_name, trend
from risk_sac.run_folder.results import read_boundary_map, read_rates
from service.errors import OutdatedError
from service.settings import ServiceSettings
from service.store.reading import Store
from service.store.stored import StoredCampaign

MOST_CAMPAIGNS = 200  # of an ego; older ones are not read


def trend_of(store: Store, settings: ServiceSettings, name: str, chosen: Sequence[str], project: str | None) -> Trend:
    """Compares the versions of an ego, by its newest campaigns or by those that are chosen.

    Raises:
      ConfigError: the chosen campaigns are of another ego, or of different scenarios.
      NotFoundError: there is no such campaign.
    """
    if chosen:
        stored = sorted((store.campaign(id_, project) for id_ in set(chosen)), key=lambda campaign: campaign.number)
    else:
        stored = store.campaigns_of_ego(name, project, MOST_CAMPAIGNS)
    ended: list[EndedCampaign] = []
    left_out: list[LeftOut] = []
    for campaign in stored:
        try:
            read = _ended(campaign, settings)
        except OutdatedError as error:
            left_out.append(LeftOut(campaign_id=campaign.id, reason=str(error)))
            continue
        if driver_name(read.spec.ego) != name:
            raise ConfigError("campaign", f"{read.id}, of the ego {driver_name(read.spec.ego)!r}", f"one of {name!r}")
        if campaign.state is State.SUCCEEDED:
            ended.append(read)
        else:
            left_out.append(LeftOut(campaign_id=campaign.id, reason=f"it is {campaign.state}"))
    if chosen:
        check_scenarios(ended)
    return trend(ended, left_out)


def _ended(campaign: StoredCampaign, settings: ServiceSettings) -> EndedCampaign:
    runs = (
        EndedRun(
            family=run.family,
            method=run.method,
            iid=run.iid,
            phases=tuple(phase for phase in (run.metrics, run.evaluation) if phase is not None),
            versions=run.versions,
            boundary=read_boundary_map(settings.run_folder(campaign.id, run.id)) if run.method == "boundary" else None,
            rates=read_rates(settings.run_folder(campaign.id, run.id)) if run.method == "rate" else None,
        )
        for run in campaign.runs
    )
    return EndedCampaign(id=campaign.id, spec=campaign.spec, runs=tuple(runs), at=campaign.created_at)
