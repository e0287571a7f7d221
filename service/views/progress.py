"""Campaigns as they are answered: how far one is and when it will end. Pure."""

import math
from collections.abc import Sequence

from risk_sac.config import METHODS
from risk_sac.metrics.requirements import pooled_requirements
from risk_sac.records import Campaign, CampaignSummary, Progress, RunMetrics, State
from service.store.stored import StoredCampaign, StoredRun
from service.store.tables import TALLIED

OF_ALL = ("episodes_total", "episodes_done")
OF_SEARCHES = ("rejected", *(name for name in TALLIED if name not in (*OF_ALL, "headline")))
AVERAGED = ("window_ecr", "window_pcr", "dual_variable", "temperature")
LOOKS = 20  # polls of a client from now to the end of a campaign
SOONEST_S, LATEST_S = 1, 30
LEARNING = {name for name, method in METHODS.items() if method.learns}


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
    """Counts over all runs, present values of the runs at work, and the time left; `workers` as in `eta_s`."""
    runs, searches = campaign.runs, campaign.searches
    present = _present(searches)
    sums = {name: sum(getattr(run, name) for run in runs) for name in OF_ALL}
    sums |= {name: sum(getattr(run, name) for run in searches) for name in OF_SEARCHES}
    means = {name: _mean([getattr(metrics, name) for metrics in present]) for name in AVERAGED}
    eta = 0.0 if campaign.state.final else eta_s(runs, workers)
    return Progress.model_validate(sums | means | {"headline": campaign.headline, "eta_s": eta})


def retry_after_s(campaign: StoredCampaign, workers: int) -> int | None:
    """Seconds after which to ask again: a twentieth of the time left, or None once the campaign has ended."""
    if campaign.state.final:
        return None
    left_s = eta_s(campaign.runs, workers) or 0.0
    return math.ceil(min(max(left_s / LOOKS, SOONEST_S), LATEST_S))


def eta_s(runs: Sequence[StoredRun], workers: int) -> float | None:
    """Seconds until all runs have ended; None before the first episode has, or while there is nowhere to execute them.

    eta = max(longest run at work, work left / workers)

    Each run goes at its own pace, and one without a pace at the mean of those that have one.
    Campaigns ahead in the queue are not counted.

    Args:
      runs: all runs of the campaign.
      workers: runs that are executed at once; 0 while that is unknown.
    """
    busy_s = sum(run.busy_s for run in runs)
    done = sum(run.episodes_done for run in runs)
    if done == 0 or workers == 0:
        return None
    left = [_left(run, busy_s / done) for run in runs if not run.state.final]
    return max(max(left, default=0.0), sum(left) / workers)


def _left(run: StoredRun, mean_pace_s: float) -> float:
    pace_s = run.busy_s / run.episodes_done if run.episodes_done else mean_pace_s
    return pace_s * max(0, run.episodes_total - run.episodes_done)


def _present(runs: Sequence[StoredRun]) -> list[RunMetrics]:
    searching = [run for run in runs if run.method in LEARNING] or runs
    at_work = [run for run in searching if run.state in (State.RUNNING, State.CANCELLING)]
    return [run.metrics for run in at_work or searching if run.metrics is not None]


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None
