"""The scripted worker, but in every second episode the ego fails, and every third failure repeats the one before.

Those in episodes 1, 7, 13, … are preventable.
"""

import scripted_worker

from risk_sac.metrics import wilson_interval
from risk_sac.types import Collision, EpisodeRecord, Grade, Outcome, RunMetrics
from tests.judged import judgement

COLLISION = Collision(
    time_s=3.9,
    other_id="lead",
    other_kind="vehicle",
    other_role="adversary",
    contact_x_m=2.3,
    contact_y_m=0.1,
    ego_zone="front",
    other_zone="rear",
    ego_speed_mps=9.0,
    other_speed_mps=2.0,
    relative_speed_mps=7.0,
    lateral_offset_m=0.1,
    min_ttc_s=0.4,
    min_rss_margin_m=-3.0,
    visible_for_s=3.0,
    ego_peak_braking_mps2=4.5,
    min_robustness=-1.0,
    simulator_agrees=True,
    verdicts={"inside_grip": True},
)
_record, _metrics = scripted_worker.record, scripted_worker.metrics


def record(index: int) -> EpisodeRecord:
    if index % 2 == 0:
        return _record(index)
    preventable = index % 6 == 1
    judged = judgement(Grade.CAREFUL if preventable else Grade.IDEAL, broke=("red_light",) if preventable else ())
    collision = COLLISION.model_copy(update={"judgement": judged})
    return _record(index).model_copy(update={"outcome": Outcome.FAILURE, "collision": collision})


def metrics(episodes: int) -> RunMetrics:
    failures = episodes // 2
    preventable = (failures + 2) // 3
    low, high = wilson_interval(preventable, episodes)
    found = {
        "failures": failures,
        "raw_collisions": failures,
        "ecr": failures / episodes,
        "distinct_failures": failures - failures // 3,
        "preventable": preventable,
        "distinct_preventable": preventable,
        "pcr": preventable / episodes,
        "pcr_low": low,
        "pcr_high": high,
        "signatures": {"cut-in, straight": failures},
    }
    return _metrics(episodes).model_copy(update=found)


if __name__ == "__main__":
    scripted_worker.record, scripted_worker.metrics = record, metrics
    scripted_worker.main()
