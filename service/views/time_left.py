"""Estimates a campaign's remaining time from the pace of its runs. Pure.

The pace of a run is the mean time of its newest episodes, without the start of its worker.
"""

import math
from collections.abc import Sequence
from statistics import fmean

from risk_sac.config import METHODS, CampaignSpec
from service.store.stored import StoredCampaign, StoredRun

LEARNING = {name for name, method in METHODS.items() if method.learns}
LOOKS = 20  # polls of a client from now to the end of a campaign
SOONEST_S, LATEST_S = 1, 30


def eta_s(runs: Sequence[StoredRun], spec: CampaignSpec, workers: int) -> float | None:
    """Estimates the seconds until all runs have ended.

    Returns None until a run has played two episodes, or while nothing can execute them.

    eta = max(longest run at work, work left / workers)

    Each run goes at its own pace; one without a pace at the mean of its method in its family, else of its method, else
    of all. A learner that still warms up is estimated too short. Campaigns ahead in the queue are not counted.

    Args:
      runs: all runs of the campaign.
      spec: what was posted.
      workers: runs that are executed at once; 0 while that is unknown.
    """
    known = [run for run in runs if run.pace_s is not None]
    if not known or workers == 0:
        return None
    start_s = min(max(0.0, run.busy_s - run.episodes_done * _pace_s(run, known)) for run in known)
    left = [_left_s(run, spec, _pace_s(run, known), start_s) for run in runs if not run.state.final]
    return max(max(left, default=0.0), sum(left) / workers)


def _pace_s(run: StoredRun, known: Sequence[StoredRun]) -> float:
    """Time of an episode of the run, s; without a pace of its own that of the runs most like it."""
    if run.pace_s is not None:
        return run.pace_s
    of_method = [other for other in known if other.method == run.method]
    alike = [other for other in of_method if other.family == run.family] or of_method or known
    return fmean(other.pace_s for other in alike if other.pace_s is not None)


def _left_s(run: StoredRun, spec: CampaignSpec, pace_s: float, start_s: float) -> float:
    """Time that the run still needs, s; a limit of processor time ends its search sooner."""
    done = run.episodes_done
    evaluation = 0 if run.iid else spec.budget.evaluation_episodes
    search_s = max(0, run.episodes_total - evaluation - done) * pace_s
    if spec.budget.cpu_s is not None and not run.iid:
        search_s = min(search_s, max(0.0, spec.budget.cpu_s - run.busy_s))
    evaluation_s = min(evaluation, max(0, run.episodes_total - done)) * pace_s
    return search_s + evaluation_s + (0.0 if done else start_s)


def retry_after_s(campaign: StoredCampaign, workers: int) -> int | None:
    """Computes when to ask again, s: after a twentieth of the time left.

    Returns None once the campaign has ended.
    """
    if campaign.state.final:
        return None
    left_s = eta_s(campaign.runs, campaign.spec, workers) or 0.0
    return math.ceil(min(max(left_s / LOOKS, SOONEST_S), LATEST_S))
