import math

import pytest

from risk_sac.execution.messages import EpisodeDone
from risk_sac.records import Outcome
from tests.builders import collision, episode_record, judgement, run_metrics


@pytest.fixture
def metrics():
    return run_metrics(
        4,
        rejected=1,
        raw_collisions=2,
        collisions=1,
        failures=1,
        environment_steps=400,
        ecr=0.25,
        ecr_low=0.05,
        ecr_high=0.7,
        window_ecr=0.25,
        efficiency=0.5,
        cost_rate=0.1,
        dispersion=None,
        dual_variable=0.3,
        temperature=0.2,
        distinct_failures=1,
        steps_per_distinct_failure=400.0,
        preventable=1,
        preventable_collisions=1,
        pcr=0.25,
        pcr_low=0.05,
        pcr_high=0.7,
        window_pcr=0.25,
        distinct_preventable=1,
        artefacts=1,
        unresponsive=0,
        kinds={"cut-in, straight": 1},
        conflicts_by_second=(0, 0, 1, 0),
        contacts_by_second=(0, 0, 0, 1),
    )


@pytest.fixture
def episode(metrics):
    """Builds an episode's report; TTC minima: contact NaN, episode infinity."""
    contact = collision(
        early_min_ttc_s=math.nan, early_min_robustness=-math.inf, verdicts={"feasible": True}, judgement=judgement()
    )

    def build(index, outcome=Outcome.SAFE, phase="search", wall_s=0.5):
        touched = outcome in (Outcome.FAILURE, Outcome.DEGENERATE)
        record = episode_record(
            index,
            outcome,
            phase=phase,
            seed=7,
            steps=100,
            shaped_return=2.0,
            min_ttc_s=math.inf,
            min_robustness=0.2,
            collision=contact if touched else None,
        )
        return EpisodeDone(record=record, metrics=metrics, series="a.npz" if touched else None, wall_s=wall_s)

    return build
