"""Episodes of a run, some by hand and any at all, and what a run makes of them."""

import math
from itertools import combinations

from hypothesis import strategies as st

from risk_sac.metrics import WINDOW, MetricsAccumulator, Tally, outcome_features, preventable
from risk_sac.types import Collision, EpisodeRecord, Grade, Outcome
from risk_sac.verdicts.distinct import distinct_failures
from tests.judged import judgement

HORIZON = 150


def collision(
    ttc=0.3, speed=10.0, offset=0.0, robustness=-1.0, other="adv_0", ego_zone="front", other_zone="rear", **more
):
    values = {"time_s": 3.0, "verdicts": {"warm-up": True}} | more
    return Collision(
        other_id=other,
        other_kind="vehicle",
        other_role="adversary",
        contact_x_m=2.0,
        contact_y_m=0.1,
        ego_zone=ego_zone,
        other_zone=other_zone,
        ego_speed_mps=12.0,
        other_speed_mps=2.0,
        relative_speed_mps=speed,
        lateral_offset_m=offset,
        min_ttc_s=ttc,
        min_rss_margin_m=-4.0,
        visible_for_s=2.0,
        ego_peak_braking_mps2=4.5,
        min_robustness=robustness,
        simulator_agrees=True,
        **values,
    )


def episode(outcome=Outcome.SAFE, steps=HORIZON, cost=0.0, hit=None, **changes):
    if outcome is Outcome.REJECTED:
        steps = 0
    if hit is None and outcome in (Outcome.FAILURE, Outcome.DEGENERATE):
        hit = collision()
    values = {
        "index": 0,
        "phase": "train",
        "seed": 1,
        "scene": {"gap_m": 10.0, "speed_mps": 12.5},
        "reason": "",
        "risk_return": 1.0,
        "shaped_return": 0.5,
        "min_ttc_s": 0.3,
        "min_robustness": -1.0,
        "objective": 0.2,
        "dual_variable": 0.7,
        "temperature": 0.1,
        "environment_steps": 0,
    } | changes
    return EpisodeRecord(outcome=outcome, steps=steps, mean_cost=cost, collision=hit, **values)


def feed(records):
    accumulator = MetricsAccumulator(HORIZON)
    for record in records:
        accumulator.add(record)
    return accumulator.metrics()


def counted(records):
    """What `Tally` counts, at once and by the definitions."""
    hits = [record.collision for record in records if record.outcome is Outcome.FAILURE]
    newest = records[-WINDOW:]
    points = [outcome_features(hit) for hit in hits]
    return Tally(
        horizon_steps=HORIZON,
        episodes=len(records),
        failures=len(hits),
        preventable=sum(hit.preventable for hit in hits),
        distinct_failures=len(distinct_failures(hits)),
        environment_steps=sum(record.steps for record in records),
        steps_to_failure=sum(record.steps if record.outcome is Outcome.FAILURE else HORIZON for record in records),
        cost=math.fsum(record.mean_cost * record.steps for record in records if record.steps),
        distance=math.fsum(math.dist(one, other) for one, other in combinations(points, 2)),
        newest_episodes=len(newest),
        newest_failures=sum(record.outcome is Outcome.FAILURE for record in newest),
        newest_preventable=sum(map(preventable, newest)),
    )


any_judgement = st.builds(
    judgement,
    grade=st.sampled_from(Grade),
    conflict_s=st.floats(-5, 20),
    unresponsive=st.booleans(),
    signature=st.sampled_from(("cut-in", "pedestrian", "leader")),
)
any_collision = st.builds(
    collision,
    judgement=st.none() | any_judgement,
    time_s=st.floats(0, 15),
    ttc=st.floats(0, math.inf),
    speed=st.floats(0, 60),
    offset=st.floats(-10, 10),
    robustness=st.floats(-math.inf, math.inf),
)
any_episode = st.builds(
    episode,
    outcome=st.sampled_from(Outcome),
    steps=st.integers(1, HORIZON),
    cost=st.floats(0, 1),
    hit=any_collision,
)
any_run = st.lists(any_episode, max_size=40)


RUN = [
    episode(Outcome.FAILURE, 30, 0.2, collision(ttc=0.0, speed=0.0, offset=-3.5, robustness=-3.0)),
    episode(Outcome.SAFE, 150, 0.1),
    episode(Outcome.REJECTED, cost=math.nan),  # no step, no mean cost: whatever stands there is ignored
    episode(Outcome.DEGENERATE, 70, 0.0),
    episode(Outcome.FAILURE, 50, 0.4, collision(ttc=3.0, speed=0.0, offset=-3.5, robustness=-3.0)),
]


JUDGED = [
    # Contact at 3.9 s, and the same again, which is not distinct.
    *[episode(Outcome.FAILURE, 39, hit=collision(time_s=3.9, judgement=judgement(conflict_s=2.5)))] * 2,
    episode(Outcome.FAILURE, 60, hit=collision(time_s=6.0, other="adv_1", judgement=judgement(Grade.IDEAL, 3.0))),
    episode(
        Outcome.FAILURE,
        150,
        hit=collision(
            time_s=15.0,
            other="adv_2",
            judgement=judgement(Grade.CAREFUL, -0.4, signature="pedestrian, straight", unresponsive=True),
        ),
    ),
    episode(Outcome.FAILURE, 20, hit=collision(time_s=2.0, other="adv_3")),  # from before contacts were judged
    # Its striker left the grip of its tyres: an artefact, which nobody judged and whose grade would not count.
    episode(
        Outcome.DEGENERATE, 30, hit=collision(verdicts={"inside_grip": False}, judgement=judgement(unresponsive=True))
    ),
    episode(Outcome.DEGENERATE, 30, hit=collision(verdicts={"ego_moving": False})),
    episode(),
]
