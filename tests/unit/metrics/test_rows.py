from risk_sac.metrics import METRICS, RATIOS, Tally
from risk_sac.metrics.rows import (
    cost_rate,
    effective_collision_rate,
    efficiency_score,
    outcome_dispersion,
    preventable_collision_rate,
    steps_per_distinct_failure,
)
from risk_sac.records import Counts

FORMULAS = {metric.name: metric.formula for metric in METRICS}


def test_formula_literals():
    tally = Tally(
        horizon_steps=150,
        episodes=8,
        failures=4,
        preventable=2,
        avoidable=3,
        distinct_failures=3,
        environment_steps=600,
        steps_to_failure=900,
        cost=150.0,
        distance=6.0,
        newest_episodes=5,
        newest_failures=3,
        newest_preventable=1,
    )
    assert (effective_collision_rate(tally), preventable_collision_rate(tally)) == (0.5, 0.25)
    assert FORMULAS["acr"](tally) == 0.375
    assert (FORMULAS["ecr_last"](tally), FORMULAS["pcr_last"](tally)) == (0.6, 0.2)
    assert efficiency_score(tally) == 1 - 900 / (8 * 150) == 0.25
    assert cost_rate(tally) == 0.25
    assert outcome_dispersion(tally) == 0.5  # 6 over six pairs, over √4
    assert (FORMULAS["distinct_per_1000_steps"](tally), steps_per_distinct_failure(tally)) == (5, 200)


def test_ratio_literals():
    counts = Counts(
        episodes=20,
        rejected=1,
        raw_collisions=9,
        failures=5,
        distinct_failures=2,
        artefacts=3,
        unresponsive=2,
        environment_steps=700,
    )
    assert {ratio.name: ratio.formula(counts) for ratio in RATIOS} == {
        "steps_per_distinct_failure": 350,
        "raw_rate": 0.45,
        "artefact_rate": 0.15,
        "degenerate_rate": 0.2,
        "rejected_rate": 0.05,
        "unresponsive_share": 0.4,
    }
