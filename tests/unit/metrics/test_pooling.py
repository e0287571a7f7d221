import pytest

from risk_sac.metrics import (
    METRICS,
    RESAMPLING_SEED,
    Estimate,
    bootstrap_interval,
    estimate,
    mean_over_runs,
    pcr_by_driver,
    pooled_counts,
    pooled_names,
    wilson_interval,
)
from risk_sac.records import DriverPcr
from tests.unit.metrics.episodes import JUDGED, RUN, episode, feed


def test_runs_are_pooled_by_sums_and_signatures_keep_their_order():
    metrics = [feed(JUDGED), feed(JUDGED[3:])]
    counts = pooled_counts(metrics)
    assert (counts.episodes, counts.raw_collisions, counts.failures) == (13, 11, 7)
    assert (counts.distinct_failures, counts.preventable, counts.distinct_preventable) == (6, 4, 3)
    assert (counts.artefacts, counts.unresponsive, counts.environment_steps) == (2, 2, 518 + 380)
    assert list(pooled_names([each.signatures for each in metrics]).items()) == [
        ("cut-in, straight", 3),
        ("pedestrian, straight", 2),
        ("unjudged adversary vehicle", 2),
    ]


def test_each_drivers_pcr_is_over_the_runs_that_asked_it():
    asked = feed([*JUDGED[:4], episode()])  # r157 prevents 3 of 4 contacts in 5 episodes
    clean, old = feed([episode()] * 3), feed(JUDGED).model_copy(update={"prevented_by": {}})
    pooled = pcr_by_driver([asked, clean, old])
    low, high = wilson_interval(3, 8)
    assert pooled["r157"] == DriverPcr(prevented=3, pcr=3 / 8, pcr_low=low, pcr_high=high)
    assert pcr_by_driver([old]) == pcr_by_driver([clean]) == pcr_by_driver([]) == {}


def test_metrics_are_pooled_by_their_mean_over_the_runs_that_have_a_value():
    rows = {metric.name: metric for metric in METRICS}
    one, other = feed(RUN), feed(JUDGED)
    assert estimate(rows["ecr"], [one]) == Estimate(
        mean=0.4, low=wilson_interval(2, 5)[0], high=wilson_interval(2, 5)[1], runs=1
    )
    assert estimate(rows["ecr"], [one, other]).mean == pytest.approx(0.5125)
    without = feed(RUN[:1])
    assert estimate(rows["ofd"], [one, without]) == Estimate(mean=one.dispersion, low=None, high=None, runs=1)
    assert mean_over_runs(rows["ofd"], [without]) is None
    assert estimate(rows["ofd"], [without]) == Estimate(mean=None, low=None, high=None, runs=0)


def test_the_interval_of_a_rate_is_the_wider_of_bootstrap_and_wilson():
    ecr = next(metric for metric in METRICS if metric.name == "ecr")
    clean = [feed([episode()] * 5), feed([episode()] * 5)]
    assert estimate(ecr, clean).low == 0.0
    assert estimate(ecr, clean).high == pytest.approx(0.2775, abs=1e-4)  # 1.96² / (10 + 1.96²)
    apart = [feed([episode()] * 50)] * 5 + [feed(JUDGED * 6)] * 5
    low, high = bootstrap_interval([0.0] * 5 + [0.625] * 5, RESAMPLING_SEED)
    found = estimate(ecr, apart)
    assert (found.low, found.high) == (pytest.approx(low), pytest.approx(high))
