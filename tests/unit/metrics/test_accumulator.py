import math

import pytest
from hypothesis import given, settings

from risk_sac.errors import NotFinite
from risk_sac.metrics import WINDOW, MetricsAccumulator, wilson_interval
from risk_sac.metrics.rows import (
    cost_rate,
    effective_collision_rate,
    efficiency_score,
    outcome_dispersion,
    preventable_collision_rate,
)
from risk_sac.records import Funnel, Grade, Outcome, PlausibilityClass, Severity
from risk_sac.verdicts.distinct import distinct_failures, taxonomy_cell
from tests.builders import AVOIDS, TOUCHES, judgement, plausibility
from tests.unit.metrics.episodes import HORIZON, JUDGED, RUN, any_run, contact, counted, episode, feed

ORDINARY, IMPLAUSIBLE = PlausibilityClass.ORDINARY, PlausibilityClass.IMPLAUSIBLE


def test_run_literals():
    metrics = feed(RUN)
    assert (metrics.episodes, metrics.rejected, metrics.raw_collisions, metrics.failures) == (5, 1, 3, 2)
    assert metrics.environment_steps == 300
    assert metrics.ecr == metrics.window_ecr == 0.4
    assert (metrics.ecr_low, metrics.ecr_high) == wilson_interval(2, 5)
    assert metrics.efficiency == pytest.approx(1 - (30 + 150 + 150 + 150 + 50) / (5 * 150))
    assert metrics.cost_rate == pytest.approx((0.2 * 30 + 0.1 * 150 + 0.4 * 50) / 300)
    assert metrics.dispersion == pytest.approx(0.5)  # one feature of four differs, by its whole range: 1/√4
    assert (metrics.distinct_failures, metrics.steps_per_distinct_failure) == (1, 300)  # alike
    assert (metrics.dual_variable, metrics.temperature) == (0.7, 0.1)


def test_funnel_literals():
    metrics = feed(JUDGED)
    assert Funnel.of(metrics) == Funnel(contacts=7, valid=5, distinct=3, preventable=2, published=2)
    assert (metrics.preventable, metrics.artefacts, metrics.unresponsive) == (3, 1, 1)
    assert metrics.pcr == metrics.window_pcr == preventable_collision_rate(counted(JUDGED)) == 3 / 8
    # Wilson for 3 of 8 by hand: centre (0.375 + 0.2401)/1.4802 = 0.4155, half width 0.2787.
    assert (metrics.pcr_low, metrics.pcr_high) == pytest.approx((0.1368, 0.6943), abs=5e-4)


def test_what_only_the_defensive_driver_prevents_is_preventable_and_not_published():
    by_defensive = judgement(drivers={"r157": TOUCHES, "defensive": AVOIDS}, variant="alongside")
    metrics = feed([episode(Outcome.FAILURE, 10, hit=contact(judgement=by_defensive))] * 2)
    assert (metrics.distinct_preventable, metrics.distinct_published) == (1, 0)
    assert metrics.prevented_by == {"r157": 0, "defensive": 2, "published": 0}
    metrics = feed([episode(Outcome.FAILURE, 10, hit=contact(judgement=each)) for each in (by_defensive, judgement())])
    assert (metrics.distinct_preventable, metrics.distinct_published, metrics.variants) == (1, 1, 2)


def test_implausible_kinds_are_counted_apart_from_candidates():
    plain, wild = (judgement(kind="cut-in", plausibility=plausibility(each)) for each in (ORDINARY, IMPLAUSIBLE))
    minor = judgement(kind="cut-in", severity=Severity.MINOR, plausibility=plausibility(IMPLAUSIBLE))
    hits = [contact(judgement=each) for each in (wild, wild, minor)]
    counts = feed([episode(Outcome.FAILURE, hit=hit) for hit in hits])
    assert (counts.distinct_preventable, counts.headline_candidates, counts.implausible) == (1, 0, 1)
    hits.append(contact(judgement=plain))
    counts = feed([episode(Outcome.FAILURE, hit=hit) for hit in hits])
    assert (counts.distinct_preventable, counts.headline_candidates, counts.implausible) == (1, 1, 1)


def test_histogram_literals():
    """Conflicts and contacts are counted by second.

    Conflicts at 2.5 s twice, 3.0 s, 1.5 s and before the release; contacts at 3.9 s twice, at 6, 15 and 2 s.
    """
    metrics = feed(JUDGED)
    assert metrics.conflicts_by_second == (1, 1, 2, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    assert metrics.contacts_by_second == (0, 0, 1, 2, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1)


def test_windows_forget_all_but_the_newest_100_episodes():
    failure = episode(Outcome.FAILURE, 10, hit=contact(judgement=judgement()))
    records = [failure] * 50 + [episode()] * 80 + [failure, episode(Outcome.FAILURE, 10)] * 5
    metrics = feed(records)
    assert (metrics.window_ecr, metrics.window_pcr) == (0.2, 0.15)
    assert metrics.ecr == pytest.approx(60 / 140)
    assert metrics.window_pcr == preventable_collision_rate(counted(records[-WINDOW:]))


def test_bad_records_are_refused_and_leave_the_figures_alone():
    accumulator = MetricsAccumulator(HORIZON)
    before = accumulator.metrics()
    with pytest.raises(NotFinite, match="outcome features"):
        accumulator.add(episode(Outcome.FAILURE, 10, hit=contact(ttc=math.nan)))
    with pytest.raises(NotFinite, match="finite times"):
        accumulator.add(episode(Outcome.FAILURE, 10, hit=contact(judgement=judgement(conflict_s=-math.inf))))
    with pytest.raises(NotFinite, match="mean_cost"):
        accumulator.add(episode(cost=math.nan))
    with pytest.raises(ValueError, match="without a valid violation"):
        accumulator.add(episode(Outcome.FAILURE, 10).model_copy(update={"collision": None}))
    assert accumulator.metrics() == before
    with pytest.raises(ValueError, match="horizon_steps"):
        MetricsAccumulator(0)


@settings(deadline=None)
@given(any_run)
def test_figures_stay_in_their_ranges(records):
    metrics = feed(records)
    assert 0 <= metrics.ecr_low <= metrics.ecr <= metrics.ecr_high <= 1
    assert 0 <= metrics.window_ecr <= 1
    assert 0 <= metrics.efficiency <= 1
    assert 0 <= metrics.cost_rate <= 1
    assert metrics.dispersion is None or 0 <= metrics.dispersion <= 1
    assert 0 <= metrics.pcr_low <= metrics.pcr <= metrics.pcr_high <= 1
    assert 0 <= metrics.window_pcr <= metrics.window_ecr
    assert metrics.pcr <= metrics.ecr
    funnel = Funnel.of(metrics)
    assert funnel.contacts >= funnel.valid >= funnel.distinct >= funnel.preventable >= 0
    assert metrics.unresponsive <= metrics.failures
    assert metrics.distinct_preventable <= metrics.preventable <= metrics.avoidable <= metrics.failures


@settings(deadline=None)
@given(any_run)
def test_incremental_equals_batch(records):
    metrics = feed(records)
    hits = [record.collision for record in records if record.outcome is Outcome.FAILURE]
    assert metrics.ecr == effective_collision_rate(counted(records))
    assert metrics.window_ecr == effective_collision_rate(counted(records[-WINDOW:]))
    assert metrics.pcr == preventable_collision_rate(counted(records))
    assert metrics.window_pcr == preventable_collision_rate(counted(records[-WINDOW:]))
    assert metrics.distinct_preventable == len(distinct_failures([hit for hit in hits if hit.preventable]))
    assert metrics.avoidable == sum(hit.judgement.grade in (Grade.PREVENTABLE, Grade.FULL_BRAKING) for hit in hits)
    assert sum(metrics.conflicts_by_second) == sum(metrics.contacts_by_second) == len(hits)
    assert sum(metrics.kinds.values()) == len(hits)
    assert metrics.covered == len({taxonomy_cell(hit) for hit in hits})
    assert metrics.efficiency == pytest.approx(efficiency_score(counted(records)), abs=1e-12)
    assert metrics.cost_rate == pytest.approx(cost_rate(counted(records)), abs=1e-12)
    assert metrics.distinct_failures == len(distinct_failures(hits))
    assert metrics.dispersion == pytest.approx(outcome_dispersion(counted(records)), abs=1e-12)
