"""Progress of a campaign. Pure."""

from collections.abc import Sequence

from risk_sac.metrics.requirements import pooled_requirements
from risk_sac.records import Campaign, CampaignSummary, Progress, RunMetrics, State
from service.store.stored import StoredCampaign, StoredRun
from service.store.tables import TALLIED
from service.views.time_left import LEARNING, eta_s

OF_ALL = ("episodes_total", "episodes_done")
OF_SEARCHES = ("rejected", *(name for name in TALLIED if name not in (*OF_ALL, "headline")))
AVERAGED = ("window_ecr", "window_pcr", "dual_variable", "temperature")


def campaign_body(campaign: StoredCampaign, workers: int) -> Campaign:
    """A campaign in full; `workers` as `progress` has it."""
    pooled = pooled_requirements([run.metrics for run in campaign.searches if run.metrics is not None])
    return Campaign(
        **dict(summary_body(campaign, workers)), runs=campaign.runs, requirements=pooled, spec=campaign.spec
    )


def summary_body(campaign: StoredCampaign, workers: int) -> CampaignSummary:
    """A campaign in a list; `workers` as `progress` has it."""
    stored = {name: getattr(campaign, name) for name in CampaignSummary.model_fields.keys() - {"progress"}}
    return CampaignSummary(**stored, progress=progress(campaign, workers))


def progress(campaign: StoredCampaign, workers: int) -> Progress:
    """Returns counts over all runs, current values of running ones, and the time left."""
    runs, searches = campaign.runs, campaign.searches
    present = _present(searches)
    sums = {name: sum(getattr(run, name) for run in runs) for name in OF_ALL}
    sums |= {name: sum(getattr(run, name) for run in searches) for name in OF_SEARCHES}
    means = {name: _mean([getattr(metrics, name) for metrics in present]) for name in AVERAGED}
    waiting = sum(run.headline_candidates for run in searches if run.metrics is None or run.metrics.headline is None)
    eta = 0.0 if campaign.state.final else eta_s(runs, campaign.spec, workers)
    rest = {"headline": campaign.headline, "headline_waiting": waiting, "eta_s": eta}
    return Progress.model_validate(sums | means | rest)


def _present(runs: Sequence[StoredRun]) -> list[RunMetrics]:
    searching = [run for run in runs if run.method in LEARNING] or runs
    at_work = [run for run in searching if run.state in (State.RUNNING, State.CANCELLING)]
    return [run.metrics for run in at_work or searching if run.metrics is not None]


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None
