"""Estimates a campaign's remaining time from pace and cost of episodes. Pure.

The pace of a run leaves out the start of its worker, which is spent once and not once per episode.
"""

import math
from collections.abc import Mapping, Sequence
from statistics import fmean

from risk_sac.config import METHODS, CampaignSpec
from service.store.stored import StoredCampaign, StoredRun

_SAC, _DDPG, _SCRIPTED = 9.0, 8.5, 0.7
EPISODE_COST: Mapping[str, float] = {
    "risk-sac-diverse": 1.0,  # in `low` 1.6 over 60 episodes, elsewhere as a script
    "risk-sac-pretrained": 5.6,
    "archive": _SCRIPTED,
    "archive-replay": _SCRIPTED,
    "random": 1.0,
    "risk-sac": _SAC,
    "risk-sac-only-rper": _SAC,
    "risk-sac-only-rs": _SAC,
    "sac-lag": _SAC,
    "sac": _SAC,
    "sb3-sac": 14.0,
    "ddpg-lag": _DDPG,
    "ddpg": _DDPG,
    "bo-only": 1.3,
    "no-adversary": 0.7,
    "iid-random": 1.0,
    "iid-undisturbed": 0.7,
}
"""Processor time of an episode as a multiple of `random`'s 0.06 s; of a learner, after its warm start.

Measured in `low` with seed 0 over 100 to 250 episodes; the SAC variants and `ddpg` by the first ten episodes after
their warm start; `sb3-sac` beside `sac`, at 1.5 times its time of a step and 1.6 of an episode.
"""
WARM_COST = _SCRIPTED
"""The same of a learner's episode in its warm start, which an archive search drives without updates."""
WARM_EPISODES, WARM_BY_FAMILY = 90, {"dense": 150}
"""How long a warm start lasted in `low`, and at least where failures are rarer."""
LEARNING = {name for name, method in METHODS.items() if method.learns}
LOOKS = 20  # polls of a client from now to the end of a campaign
SOONEST_S, LATEST_S = 1, 30


def eta_s(runs: Sequence[StoredRun], spec: CampaignSpec, workers: int) -> float | None:
    """Estimates the seconds until all runs have ended.

    Returns None until a run has played two episodes, or while nothing can execute them.

    eta = max(longest run at work, work left / workers)

    Each run goes at its own pace, and one without a pace at the mean of those that have one. The pace is in seconds
    per unit of `EPISODE_COST`, so a slower method, or a learner that still warms up, does not mislead it. Campaigns
    ahead in the queue are not counted.

    Args:
      runs: all runs of the campaign.
      spec: what was posted.
      workers: runs that are executed at once; 0 while that is unknown.
    """
    work = [_Work(run, spec) for run in runs]
    paces_s = [each.pace_s for each in work if each.pace_s is not None]
    if not paces_s or workers == 0:
        return None
    mean_s, start_s = fmean(paces_s), min(each.start_s for each in work if each.pace_s is not None)
    left = [each.left_s(mean_s, start_s) for each in work if not each.run.state.final]
    return max(max(left, default=0.0), sum(left) / workers)


def retry_after_s(campaign: StoredCampaign, workers: int) -> int | None:
    """Computes when to ask again, s: after a twentieth of the time left.

    Returns None once the campaign has ended.
    """
    if campaign.state.final:
        return None
    left_s = eta_s(campaign.runs, campaign.spec, workers) or 0.0
    return math.ceil(min(max(left_s / LOOKS, SOONEST_S), LATEST_S))


class _Work:
    """Remaining work of a run, in units of `EPISODE_COST`."""

    def __init__(self, run: StoredRun, spec: CampaignSpec) -> None:
        self.run = run
        learns = run.method in LEARNING
        self._cost = EPISODE_COST.get(run.method, _SAC if learns else 1.0)
        self._cheap = WARM_COST if learns else self._cost
        self._warm_until = _warm_until(run, spec) if learns else 0
        self._search = run.episodes_total - (0 if run.iid else spec.budget.evaluation_episodes)
        self._cpu_s = math.inf if spec.budget.cpu_s is None or run.iid else spec.budget.cpu_s
        done, took_s = run.episodes_done, run.pace_s
        self.pace_s = None if took_s is None else took_s / self._units(done - 1, done)
        self.start_s = 0.0 if took_s is None else max(0.0, run.busy_s - done * took_s)

    def left_s(self, mean_pace_s: float, start_s: float) -> float:
        """Computes the time that the run still needs, s.

        `mean_pace_s` and `start_s` are used where it has no pace of its own.
        """
        done, total = self.run.episodes_done, max(self.run.episodes_done, self.run.episodes_total)
        pace_s = mean_pace_s if self.pace_s is None else self.pace_s
        searched = max(done, self._search)
        search_s = min(pace_s * self._units(done, searched), max(0.0, self._cpu_s - self.run.busy_s))
        return search_s + pace_s * self._units(searched, total) + (0.0 if done else start_s)

    def _units(self, first: int, last: int) -> float:
        """Computes the work of the episodes from `first` up to `last`.

        A frozen policy costs as much as a warm start.
        """
        learning = max(0.0, min(last, self._search) - max(first, self._warm_until))
        return learning * self._cost + (last - first - learning) * self._cheap


def _warm_until(run: StoredRun, spec: CampaignSpec) -> float:
    """Estimates the episode with which a learner's warm start ends.

    Where it has ended by its failures, it is in proportion to them.
    """
    warm_start = spec.learner.warm_start
    if run.failures >= warm_start.failures:
        return min(warm_start.episodes, run.episodes_done * warm_start.failures / run.failures)
    return min(warm_start.episodes, max(WARM_BY_FAMILY.get(run.family, WARM_EPISODES), run.episodes_done))
