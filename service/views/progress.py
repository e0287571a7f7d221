"""Progress of campaigns, times left, and ends of worker logs."""

import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean

from risk_sac.config import METHODS, CampaignSpec
from risk_sac.execution.messages import without_folders
from risk_sac.metrics.tally import pooled_requirements
from risk_sac.records import Campaign, CampaignSummary, Progress, RunMetrics, State
from service.errors import StorageError
from service.store.stored import StoredCampaign, StoredRun
from service.store.tables import TALLIED

MOST_BYTES = 256 << 10  # that are read
_UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")  # moves a cursor, or text


def log_tail(log: Path, lines: int) -> str:
    """Returns the last lines of a log, at most `lines` and `MOST_BYTES`.

    They name no folders of this machine. U+FFFD replaces what is not UTF-8 and what would control a terminal.
    """
    text = _UNSEEN.sub("\ufffd", _end(log).decode(errors="replace").replace("\r\n", "\n").replace("\r", "\n"))
    last = "\n".join(text.removesuffix("\n").split("\n")[-lines:])
    return without_folders(last, log.parent) + "\n" if text else ""


def _end(log: Path) -> bytes:
    """Returns the log's end without a cut first line (half a path)."""
    try:
        with log.open("rb") as file:
            start = file.seek(max(0, file.seek(0, os.SEEK_END) - MOST_BYTES))
            content = file.read(MOST_BYTES)
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise StorageError(f"the log of the run cannot be read ({error.strerror})") from error
    return content.partition(b"\n")[2] if start else content


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
    if run.pace_s is not None:
        return run.pace_s
    of_method = [other for other in known if other.method == run.method]
    alike = [other for other in of_method if other.family == run.family] or of_method or known
    return fmean(other.pace_s for other in alike if other.pace_s is not None)


def _left_s(run: StoredRun, spec: CampaignSpec, pace_s: float, start_s: float) -> float:
    """Returns a run's remaining time, s; a processor-time limit may shorten it."""
    done = run.episodes_done
    evaluation = 0 if run.iid else spec.budget.evaluation_episodes
    search_s = max(0, run.episodes_total - evaluation - done) * pace_s
    if spec.budget.cpu_s is not None and not run.iid:
        search_s = min(search_s, max(0.0, spec.budget.cpu_s - run.busy_s))
    evaluation_s = min(evaluation, max(0, run.episodes_total - done)) * pace_s
    return search_s + evaluation_s + (0.0 if done else start_s)


def retry_after_s(campaign: StoredCampaign, workers: int) -> int | None:
    """Computes when to ask again, s: after a twentieth of remaining time.

    Returns None once the campaign has ended.
    """
    if campaign.state.final:
        return None
    left_s = eta_s(campaign.runs, campaign.spec, workers) or 0.0
    return math.ceil(min(max(left_s / LOOKS, SOONEST_S), LATEST_S))


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
    """Returns counts over all runs, current values of running ones, time left."""
    runs, searches = campaign.runs, campaign.searches
    present = _present(searches)
    sums = {name: sum(getattr(run, name) for run in runs) for name in OF_ALL}
    sums |= {name: sum(getattr(run, name) for run in searches) for name in OF_SEARCHES}
    means = {name: _mean([getattr(metrics, name) for metrics in present]) for name in AVERAGED}
    waiting = sum(run.headline_candidates for run in searches if run.metrics is None or run.metrics.headline is None)
    eta = 0.0 if campaign.state.final else eta_s(runs, campaign.spec, workers)
    headline = {"headline": campaign.headline, "headline_published": campaign.headline_published}
    rest = headline | {"headline_waiting": waiting, "eta_s": eta}
    return Progress.model_validate(sums | means | rest)


def _present(runs: Sequence[StoredRun]) -> list[RunMetrics]:
    searching = [run for run in runs if run.method in LEARNING] or runs
    at_work = [run for run in searching if run.state in (State.RUNNING, State.CANCELLING)]
    return [run.metrics for run in at_work or searching if run.metrics is not None]


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None
