"""Episodes of a run, by hand and random, and the run's counts."""

import math
from itertools import combinations

from hypothesis import strategies as st

from risk_sac.metrics import WINDOW, MetricsAccumulator, Tally, outcome_features, preventable
from risk_sac.records import Grade, Outcome
from risk_sac.verdicts.distinct import distinct_failures
from tests.builders import collision, episode_record, judgement

HORIZON = 150


def contact(ttc=0.3, speed=10.0, offset=0.0, robustness=-1.0, **changes):
    """One with these outcome features."""
    features = {
        "early_min_ttc_s": ttc,
        "relative_speed_mps": speed,
        "lateral_offset_m": offset,
        "early_min_robustness": robustness,
    }
    return collision(**({"time_s": 3.0} | features | changes))


def episode(outcome=Outcome.SAFE, steps=HORIZON, cost=0.0, hit=None, **changes):
    if outcome is Outcome.REJECTED:
        steps = 0
    if outcome not in (Outcome.FAILURE, Outcome.DEGENERATE):
        hit = None
    elif hit is None:
        hit = contact()
    values = {"scene": {"gap_m": 10.0, "speed_mps": 12.5}, "objective": 0.2, "dual_variable": 0.7, "temperature": 0.1}
    return episode_record(outcome=outcome, steps=steps, mean_cost=cost, collision=hit, **(values | changes))


def feed(records):
    accumulator = MetricsAccumulator(HORIZON)
    for record in records:
        accumulator.add(record)
    return accumulator.metrics()


def counted(records):
    """What `Tally` counts, at once and by the definitions."""
    hits = [record.collision for record in records if record.outcome is Outcome.FAILURE]
    driven = [record for record in records if record.outcome is not Outcome.INVALID]
    newest = driven[-WINDOW:]
    points = [outcome_features(hit) for hit in hits]
    return Tally(
        horizon_steps=HORIZON,
        episodes=len(records),
        collisions=len(hits),
        failures=len(hits),
        preventable=sum(hit.preventable for hit in hits),
        preventable_collisions=sum(hit.preventable for hit in hits),
        distinct_failures=len(distinct_failures(hits)),
        environment_steps=sum(record.steps for record in records),
        steps_to_failure=sum(record.steps if record.outcome is Outcome.FAILURE else HORIZON for record in driven),
        invalid=len(records) - len(driven),
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
    kind=st.sampled_from(("cut-in", "pedestrian", "leader")),
)
any_collision = st.builds(
    contact,
    judgement=any_judgement,
    time_s=st.floats(0, 15),
    ttc=st.floats(0, math.inf),
    speed=st.floats(0, 60),
    offset=st.floats(-10, 10),
    robustness=st.floats(-math.inf, math.inf),
)
any_episode = st.builds(
    episode, outcome=st.sampled_from(Outcome), steps=st.integers(1, HORIZON), cost=st.floats(0, 1), hit=any_collision
)
any_run = st.lists(any_episode, max_size=40)


RUN = [
    episode(Outcome.FAILURE, 30, 0.2, contact(ttc=0.0, speed=0.0, offset=-3.5, robustness=-3.0)),
    episode(Outcome.SAFE, 150, 0.1),
    episode(Outcome.REJECTED, cost=math.nan),  # no step, no mean cost: whatever stands there is ignored
    episode(Outcome.DEGENERATE, 70, 0.0),
    episode(Outcome.FAILURE, 50, 0.4, contact(ttc=3.0, speed=0.0, offset=-3.5, robustness=-3.0)),
]


JUDGED = [
    # Contact at 3.9 s, and the same again, which is not distinct.
    *[episode(Outcome.FAILURE, 39, hit=contact(time_s=3.9, judgement=judgement(conflict_s=2.5)))] * 2,
    episode(
        Outcome.FAILURE, 60, hit=contact(time_s=6.0, other_id="adv_1", judgement=judgement(Grade.FULL_BRAKING, 3.0))
    ),
    episode(
        Outcome.FAILURE,
        150,
        hit=contact(
            time_s=15.0,
            other_id="adv_2",
            judgement=judgement(Grade.PREVENTABLE, -0.4, kind="pedestrian, straight", unresponsive=True),
        ),
    ),
    episode(Outcome.FAILURE, 20, hit=contact(time_s=2.0, judgement=judgement(Grade.UNAVOIDABLE, 1.5, kind="leader"))),
    # Its striker left the grip of its tyres: an artefact, whose grade would not count.
    episode(
        Outcome.DEGENERATE, 30, hit=contact(verdicts={"inside_grip": False}, judgement=judgement(unresponsive=True))
    ),
    episode(Outcome.DEGENERATE, 30, hit=contact(verdicts={"ego_moving": False})),
    episode(),
]
