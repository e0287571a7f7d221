"""Scripted worker with a failure in every second episode.

Every third failure repeats the one before. Those in episodes 1, 7, 13, … are preventable, and driven by a script; the
others are driven at random.
"""

import scripted_worker

from risk_sac.metrics import wilson_interval
from risk_sac.records import NO_CONTACT, DrivenBy, EpisodeRecord, Grade, Outcome, RequirementCounts, RunMetrics
from tests.builders import LOW_SCENE, collision, episode_record, judgement, run_metrics

_record = scripted_worker.record


def record(index: int) -> EpisodeRecord:
    if index % 2 == 0:
        return _record(index)
    preventable = index % 6 == 1
    judged = judgement(
        Grade.PREVENTABLE if preventable else Grade.FULL_BRAKING, broke=("red_light",) if preventable else ()
    )
    hit = collision(time_s=3.9, early_min_ttc_s=0.4, verdicts={"inside_grip": True}, judgement=judged)
    drove = DrivenBy.SCRIPT if preventable else DrivenBy.RANDOM
    return episode_record(
        index, Outcome.FAILURE, scene=LOW_SCENE, min_ttc_s=float("inf"), collision=hit, driven_by=drove
    )


def metrics(episodes: int) -> RunMetrics:
    failures = episodes // 2
    preventable = (failures + 2) // 3
    low, high = wilson_interval(preventable, episodes)
    rate_low, rate_high = wilson_interval(failures, episodes)
    contacts = RequirementCounts(
        counts="failure",
        violated=failures,
        valid=failures,
        distinct=failures - failures // 3,
        preventable=preventable,
        published=preventable,
        rate=failures / episodes,
        rate_low=rate_low,
        rate_high=rate_high,
    )
    return run_metrics(
        episodes,
        failures=failures,
        raw_collisions=failures,
        ecr=failures / episodes,
        distinct_failures=failures - failures // 3,
        preventable=preventable,
        distinct_preventable=preventable,
        distinct_published=preventable,
        pcr=preventable / episodes,
        pcr_low=low,
        pcr_high=high,
        episodes_driven_by={"script": preventable, "random": failures - preventable},
        kinds={"cut-in, straight": failures},
        requirements={NO_CONTACT: contacts},
    )


if __name__ == "__main__":
    scripted_worker.record, scripted_worker.metrics = record, metrics
    scripted_worker.main()
