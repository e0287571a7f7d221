import dataclasses
import hashlib
import json
import math
import time
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from risk_sac.errors import NotFinite
from risk_sac.metrics import (
    FEATURES,
    WINDOW,
    Funnel,
    MetricsAccumulator,
    bootstrap_interval,
    cost_rate,
    distinct_failures,
    effective_collision_rate,
    efficiency_score,
    outcome_dispersion,
    outcome_features,
    pooled_bins,
    pooled_counts,
    pooled_signatures,
    preventable_collision_rate,
    results_digest,
    wilson_interval,
)
from risk_sac.types import Grade, Outcome, RunMetrics
from tests.builders import collision, episode_record, judgement

HORIZON = 150


def contact(ttc=0.3, speed=10.0, offset=0.0, robustness=-1.0, **changes):
    """One with these outcome features."""
    features = {"min_ttc_s": ttc, "relative_speed_mps": speed, "lateral_offset_m": offset, "min_robustness": robustness}
    return collision(**({"time_s": 3.0} | features | changes))


def episode(outcome=Outcome.SAFE, steps=HORIZON, cost=0.0, hit=None, **changes):
    if outcome is Outcome.REJECTED:
        steps = 0
    if hit is None and outcome in (Outcome.FAILURE, Outcome.DEGENERATE):
        hit = contact()
    values = {"scene": {"gap_m": 10.0, "speed_mps": 12.5}, "objective": 0.2, "dual_variable": 0.7, "temperature": 0.1}
    return episode_record(outcome=outcome, steps=steps, mean_cost=cost, collision=hit, **(values | changes))


def feed(records):
    accumulator = MetricsAccumulator(HORIZON)
    for record in records:
        accumulator.add(record)
    return accumulator.metrics()


any_judgement = st.builds(
    judgement,
    grade=st.sampled_from(Grade),
    conflict_s=st.floats(-5, 20),
    unresponsive=st.booleans(),
    signature=st.sampled_from(("cut-in", "pedestrian", "leader")),
)
any_collision = st.builds(
    contact,
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


# Intervals


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # Newcombe 1998, Table I, method 3 for the first two; closed forms 0 and z²/(n+z²) for the third.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (0, 0, 0.0, 1.0)],
)
def test_wilson_literals(successes, trials, low, high):
    assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=5e-5)


@settings(deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 10**6))
def test_wilson_contains_the_rate_and_mirrors(successes, trials):
    successes = min(successes, trials)
    low, high = wilson_interval(successes, trials)
    assert 0 <= low <= successes / trials <= high <= 1
    assert wilson_interval(trials - successes, trials) == pytest.approx((1 - high, 1 - low), abs=1e-9)


def test_bootstrap_literals():
    assert bootstrap_interval([0.4], 0) == (0.4, 0.4)
    assert bootstrap_interval([0.2, 0.2, 0.2], 0) == (0.2, 0.2)
    low, high = bootstrap_interval(list(np.linspace(0, 1, 101)), 0)
    half = 1.96 * np.linspace(0, 1, 101).std() / math.sqrt(101)
    assert (low, high) == pytest.approx((0.5 - half, 0.5 + half), abs=0.005)


@settings(deadline=None)
@given(st.lists(st.floats(0, 1), min_size=1, max_size=10), st.integers(0, 100))
def test_bootstrap_is_ordered_repeatable_and_within_the_values(values, seed):
    low, high = bootstrap_interval(values, seed)
    assert min(values) <= low <= high <= max(values)
    assert bootstrap_interval(values, seed) == (low, high)


def test_bootstrap_refuses_nothing_and_nan():
    with pytest.raises(ValueError, match="empty"):
        bootstrap_interval([], 0)
    with pytest.raises(NotFinite, match="nan"):
        bootstrap_interval([0.1, math.nan], 0)


# Literals, by hand

RUN = [
    episode(Outcome.FAILURE, 30, 0.2, contact(ttc=0.0, speed=0.0, offset=-3.5, robustness=-3.0)),
    episode(Outcome.SAFE, 150, 0.1),
    episode(Outcome.REJECTED, cost=math.nan),  # no step, no mean cost: whatever stands there is ignored
    episode(Outcome.DEGENERATE, 70, 0.0),
    episode(Outcome.FAILURE, 50, 0.4, contact(ttc=3.0, speed=0.0, offset=-3.5, robustness=-3.0)),
]


def test_run_literals():
    metrics = feed(RUN)
    assert (metrics.episodes, metrics.rejected, metrics.raw_collisions, metrics.failures) == (5, 1, 3, 2)
    assert metrics.environment_steps == 300
    assert metrics.ecr == metrics.window_ecr == 0.4
    assert (metrics.ecr_low, metrics.ecr_high) == wilson_interval(2, 5)
    assert metrics.efficiency == pytest.approx(1 - (30 + 150 + 150 + 150 + 50) / (5 * 150))
    assert metrics.cost_rate == pytest.approx((0.2 * 30 + 0.1 * 150 + 0.4 * 50) / 300)
    assert metrics.dispersion == pytest.approx(0.5)  # one feature of four differs, by its whole range: 1/√4
    assert (metrics.distinct_failures, metrics.steps_per_distinct_failure) == (1, 300)  # unjudged, alike
    assert (metrics.dual_variable, metrics.temperature) == (0.7, 0.1)


def test_outcome_features_are_scaled_and_clipped():
    np.testing.assert_allclose(outcome_features(contact(1.5, 5.0, 0.0, 0.0)), [0.5, 0.25, 0.5, 0.75])
    np.testing.assert_allclose(outcome_features(contact(math.inf, 40.0, -9.0, -math.inf)), [1, 1, 0, 0])


def test_dispersion_literals():
    assert outcome_dispersion(np.array([[0.0] * 4, [1.0] * 4])) == pytest.approx(1.0)
    corners = np.array([[0.0, 0, 0, 0], [0.6, 0, 0, 0], [0.6, 0.8, 0, 0]])
    assert outcome_dispersion(corners) == pytest.approx((0.6 + 0.8 + 1.0) / 3 / 2)


def test_window_forgets_all_but_the_newest_100_episodes():
    records = [episode(Outcome.FAILURE, 10)] * 50 + [episode()] * 80 + [episode(Outcome.FAILURE, 10)] * 5
    metrics = feed(records)
    assert metrics.window_ecr == effective_collision_rate(records[-WINDOW:]) == 0.2
    assert metrics.ecr == pytest.approx(55 / 135)


JUDGED = [
    # Contact at 3.9 s, and the same again, which is not distinct.
    *[episode(Outcome.FAILURE, 39, hit=contact(time_s=3.9, judgement=judgement(conflict_s=2.5)))] * 2,
    episode(Outcome.FAILURE, 60, hit=contact(time_s=6.0, other_id="adv_1", judgement=judgement(Grade.IDEAL, 3.0))),
    episode(
        Outcome.FAILURE,
        150,
        hit=contact(
            time_s=15.0,
            other_id="adv_2",
            judgement=judgement(Grade.CAREFUL, -0.4, signature="pedestrian, straight", unresponsive=True),
        ),
    ),
    episode(Outcome.FAILURE, 20, hit=contact(time_s=2.0, other_id="adv_3")),  # from before contacts were judged
    # Its striker left the grip of its tyres: an artefact, which nobody judged and whose grade would not count.
    episode(
        Outcome.DEGENERATE, 30, hit=contact(verdicts={"inside_grip": False}, judgement=judgement(unresponsive=True))
    ),
    episode(Outcome.DEGENERATE, 30, hit=contact(verdicts={"ego_moving": False})),
    episode(),
]


def test_funnel_literals():
    metrics = feed(JUDGED)
    assert Funnel.of(metrics) == Funnel(contacts=7, valid=5, distinct=4, preventable=2)
    assert (metrics.preventable, metrics.artefacts, metrics.unresponsive) == (3, 1, 1)
    assert metrics.pcr == metrics.window_pcr == preventable_collision_rate(JUDGED) == 3 / 8
    # Wilson for 3 of 8 by hand: centre (0.375 + 0.2401)/1.4802 = 0.4155, half width 0.2787.
    assert (metrics.pcr_low, metrics.pcr_high) == pytest.approx((0.1368, 0.6943), abs=5e-4)


def test_signatures_are_counted_in_the_order_in_which_they_were_met():
    assert list(feed(JUDGED).signatures.items()) == [("cut-in, straight", 3), ("pedestrian, straight", 1)]
    assert list(feed(JUDGED[::-1]).signatures) == ["pedestrian, straight", "cut-in, straight"]


def test_histogram_literals():
    """2.5 s twice, 3.0 s, and one conflict from before the release; contacts at 3.9 s twice, at 6 and 15 s."""
    metrics = feed(JUDGED)
    assert metrics.conflicts_by_second == (1, 0, 2, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    assert metrics.contacts_by_second == (0, 0, 0, 2, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1)


@pytest.mark.parametrize(("horizon_steps", "bins"), [(150, 15), (151, 16), (10, 1), (1, 1), (29, 3), (30, 3)])
def test_histograms_have_a_bin_for_every_second_that_is_begun(horizon_steps, bins):
    metrics = MetricsAccumulator(horizon_steps).metrics()
    assert metrics.conflicts_by_second == metrics.contacts_by_second == (0,) * bins


def test_window_of_preventable_failures_forgets_too():
    failure = episode(Outcome.FAILURE, 10, hit=contact(judgement=judgement()))
    records = [failure] * 50 + [episode()] * 80 + [failure, episode(Outcome.FAILURE, 10)] * 5
    metrics = feed(records)
    assert (metrics.window_ecr, metrics.window_pcr) == (0.2, 0.15)
    assert metrics.window_pcr == preventable_collision_rate(records[-WINDOW:])


def test_runs_are_pooled_by_sums_and_signatures_keep_their_order():
    metrics = [feed(JUDGED), feed(JUDGED[3:])]
    counts = pooled_counts(metrics)
    assert (counts["episodes"], counts["raw_collisions"], counts["failures"]) == (13, 11, 7)
    assert (counts["distinct_failures"], counts["preventable"], counts["distinct_preventable"]) == (6, 4, 3)
    assert (counts["artefacts"], counts["unresponsive"], counts["environment_steps"]) == (2, 2, 518 + 380)
    assert list(pooled_signatures(metrics).items()) == [("cut-in, straight", 3), ("pedestrian, straight", 2)]


def test_histograms_of_runs_from_before_there_were_any_add_nothing():
    assert pooled_bins([(1, 2), (), (3, 0, 1)]) == (4, 2, 1)
    assert pooled_bins([(), ()]) == pooled_bins([]) == ()


# Edge cases


def test_run_without_episodes():
    metrics = feed([])
    assert (metrics.ecr, metrics.ecr_low, metrics.ecr_high, metrics.window_ecr) == (0, 0, 1, 0)
    assert (metrics.efficiency, metrics.cost_rate, metrics.dispersion) == (0, 0, None)
    assert (metrics.distinct_failures, metrics.steps_per_distinct_failure) == (0, None)
    assert (metrics.pcr, metrics.pcr_low, metrics.pcr_high, metrics.window_pcr) == (0, 0, 1, 0)
    assert preventable_collision_rate([]) == 0


def test_run_of_rejected_scenes_only_earns_no_efficiency():
    metrics = feed([episode(Outcome.REJECTED)] * 3)
    assert (metrics.rejected, metrics.ecr, metrics.efficiency, metrics.cost_rate) == (3, 0, 0, 0)
    assert metrics.steps_per_distinct_failure is None


def test_one_failure_has_no_dispersion():
    assert feed([episode(Outcome.FAILURE, 10)]).dispersion is None
    assert outcome_dispersion(np.zeros((1, 4))) is None


def test_bad_records_are_refused_and_leave_the_figures_alone():
    accumulator = MetricsAccumulator(HORIZON)
    before = accumulator.metrics()
    with pytest.raises(NotFinite, match="outcome features"):
        accumulator.add(episode(Outcome.FAILURE, 10, hit=contact(ttc=math.nan)))
    for times in ({"time_s": math.nan}, {"judgement": judgement(conflict_s=-math.inf)}):
        with pytest.raises(NotFinite, match="finite times"):
            accumulator.add(episode(Outcome.FAILURE, 10, hit=contact(**times)))
    with pytest.raises(NotFinite, match="mean_cost"):
        accumulator.add(episode(cost=math.nan))
    with pytest.raises(ValueError, match="without a collision"):
        accumulator.add(dataclasses.replace(episode(Outcome.FAILURE, 10), collision=None))
    assert accumulator.metrics() == before
    with pytest.raises(ValueError, match="horizon_steps"):
        MetricsAccumulator(0)


# Properties


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
    assert metrics.distinct_preventable <= metrics.preventable


@settings(deadline=None)
@given(any_run)
def test_incremental_equals_batch(records):
    metrics = feed(records)
    hits = [record.collision for record in records if record.outcome is Outcome.FAILURE]
    features = np.array([outcome_features(hit) for hit in hits]).reshape(-1, len(FEATURES))
    assert metrics.ecr == effective_collision_rate(records)
    assert metrics.window_ecr == effective_collision_rate(records[-WINDOW:])
    assert metrics.pcr == preventable_collision_rate(records)
    assert metrics.window_pcr == preventable_collision_rate(records[-WINDOW:])
    distinct = [hits[position] for position in distinct_failures(hits)]
    assert metrics.distinct_preventable == sum(hit.preventable for hit in distinct)
    judged = [hit for hit in hits if hit.judgement is not None]
    assert sum(metrics.conflicts_by_second) == sum(metrics.contacts_by_second) == len(judged)
    assert sum(metrics.signatures.values()) == len(judged)
    assert metrics.efficiency == pytest.approx(efficiency_score(records, HORIZON), abs=1e-12)
    assert metrics.cost_rate == pytest.approx(cost_rate(records), abs=1e-12)
    assert metrics.distinct_failures == len(distinct_failures(hits))
    assert metrics.dispersion == pytest.approx(outcome_dispersion(features), abs=1e-12)


@settings(deadline=None)
@given(any_run)
def test_adding_stored_records_again_restores_the_same_figures(records):
    assert feed(records) == feed(records)


@settings(deadline=None)
@given(st.lists(any_collision, min_size=2, max_size=12))
def test_dispersion_agrees_with_all_pairs(hits):
    features = np.array([outcome_features(hit) for hit in hits])
    pairs = [math.dist(a, b) for i, a in enumerate(features) for b in features[:i]]
    assert outcome_dispersion(features) == pytest.approx(sum(pairs) / len(pairs) / 2, abs=1e-12)


def test_many_failures_stay_cheap_to_add():
    random = np.random.default_rng(0)
    records = [
        episode(Outcome.FAILURE, 10, hit=contact(3 * u[0], 20 * u[1], 7 * u[2] - 3.5, 4 * u[3] - 3))
        for u in random.random((5000, 4))
    ]
    began = time.process_time()
    metrics = feed(records)
    assert time.process_time() - began < 5  # about 1 s; all pairs at every add would be minutes
    assert metrics.dispersion == pytest.approx(0.7777 / 2, abs=0.01)  # mean distance in the unit 4-cube


# Digest


def test_digest_is_the_hash_of_canonical_json():
    assert results_digest([]) == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    assert results_digest(RUN) == results_digest(list(RUN))


def test_records_from_before_contacts_were_judged_keep_their_digest():
    # As the version before wrote it: of this very record, by hand.
    old = json.loads(json.dumps(dataclasses.asdict(RUN[0])))
    del old["collision"]["judgement"]
    line = json.dumps(old, sort_keys=True, separators=(",", ":")).encode() + b"\n"
    assert results_digest([RUN[0]]) == hashlib.sha256(line).hexdigest()
    judged = dataclasses.replace(RUN[0], collision=dataclasses.replace(RUN[0].collision, judgement=judgement()))
    assert results_digest([judged]) != results_digest([RUN[0]])


def test_metrics_from_before_contacts_were_judged_can_still_be_read():
    stored = dataclasses.asdict(feed(RUN))
    new = ("preventable", "pcr", "pcr_low", "pcr_high", "window_pcr", "distinct_preventable", "artefacts")
    for name in (*new, "unresponsive", "signatures", "conflicts_by_second", "contacts_by_second"):
        del stored[name]
    metrics = TypeAdapter(RunMetrics).validate_json(json.dumps(stored))
    assert (metrics.failures, metrics.preventable, metrics.pcr_low, metrics.pcr_high) == (2, 0, 0, 1)
    assert Funnel.of(metrics) == Funnel(contacts=3, valid=2, distinct=1, preventable=0)


def test_digest_does_not_depend_on_the_order_or_kind_of_mappings():
    scene = {"gap_m": 10.0, "speed_mps": 12.5}
    turned = MappingProxyType(dict(reversed(scene.items())))
    assert results_digest([episode(scene=scene)]) == results_digest([episode(scene=turned)])


@pytest.mark.parametrize(
    "change", [{"risk_return": math.nextafter(1.0, 2)}, {"steps": 149}, {"scene": {"gap_m": 10.0}}, {"objective": None}]
)
def test_digest_notices_the_smallest_change(change):
    assert results_digest([dataclasses.replace(RUN[1], **change)]) != results_digest([RUN[1]])
    assert results_digest(RUN[::-1]) != results_digest(RUN)


def test_digest_accepts_infinities_and_refuses_foreign_values():
    assert len(results_digest([episode(min_ttc_s=math.inf)])) == 64
    with pytest.raises(TypeError, match="canonical JSON"):
        results_digest([episode(scene={"gap_m": np.float32(1)})])
