import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from risk_sac.types import Collision, EpisodeRecord, Outcome, RunMetrics
from service.store.reading import Store
from service.store.writing import Ledger
from service.workers.messages import EpisodeDone
from tests.judged import judgement


@pytest.fixture
def metrics() -> RunMetrics:
    return RunMetrics(
        episodes=4,
        rejected=1,
        raw_collisions=2,
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
        pcr=0.25,
        pcr_low=0.05,
        pcr_high=0.7,
        window_pcr=0.25,
        distinct_preventable=1,
        artefacts=1,
        unresponsive=0,
        signatures={"cut-in, straight": 1},
        conflicts_by_second=(0, 0, 1, 0),
        contacts_by_second=(0, 0, 0, 1),
    )


@pytest.fixture
def episode(metrics: RunMetrics) -> Callable[..., EpisodeDone]:
    """Builds the report of an episode; a contact has a minimum TTC of NaN, all have one of infinity."""
    contact = Collision(
        time_s=3.2,
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
        min_ttc_s=math.nan,
        min_rss_margin_m=-3.0,
        visible_for_s=3.0,
        ego_peak_braking_mps2=4.5,
        min_robustness=-math.inf,
        simulator_agrees=True,
        verdicts={"feasible": True},
        judgement=judgement(),
    )

    def build(index: int, outcome: Outcome = Outcome.SAFE, phase: str = "train", wall_s: float = 0.5) -> EpisodeDone:
        touched = outcome in (Outcome.FAILURE, Outcome.DEGENERATE)
        record = EpisodeRecord(
            index=index,
            phase=phase,
            seed=7,
            scene={"lead_gap_m": 12.5},
            outcome=outcome,
            reason="",
            steps=100,
            risk_return=1.0,
            shaped_return=2.0,
            mean_cost=0.1,
            min_ttc_s=math.inf,
            min_robustness=0.2,
            objective=None,
            dual_variable=0.3,
            temperature=0.2,
            environment_steps=100 * (index + 1),
            collision=contact if touched else None,
        )
        return EpisodeDone(record=record, metrics=metrics, series="a.npz" if touched else None, wall_s=wall_s)

    return build


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """An empty database of each kind."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path}/test.db"
    url: str = request.getfixturevalue("postgresql").new_database()
    return url


@pytest.fixture
def store(database_url: str) -> Iterator[Store]:
    store = Store(database_url)
    yield store
    store.close()


@pytest.fixture
def ledger(store: Store) -> Ledger:
    return Ledger(store)
