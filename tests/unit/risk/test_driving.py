import math

import pytest

from risk_sac.risk.driving import (
    FEATURES,
    LEAST,
    LogisticSpread,
    LognormalSpread,
    LowerTail,
    NormalSpread,
    RoadUserFeature,
    UpperTail,
    tail_probability,
)

SPREADS = [
    NormalSpread(1.34, 0.26),
    LognormalSpread(3.16, 0.264),
    LogisticSpread(6.5, 1.01),
    UpperTail((0.0, 2.0, 5.0), (1.0, 0.1, 1e-3)),
    LowerTail(UpperTail((-10.0, -4.0, -1.0), (1.0, 0.2, 0.01))),
]


@pytest.mark.parametrize("spread", SPREADS, ids=lambda spread: type(spread).__name__)
def test_the_two_tails_of_a_distribution_add_up_to_one(spread):
    for value in (0.5, 1.0, 3.0, 6.0, 9.0):
        assert spread.below(value) + spread.above(value) == pytest.approx(1.0)
        assert spread.above(value) >= spread.above(value + 0.5)


def test_tails_are_those_of_the_sources():
    gap, duration, braking = (FEATURES[name].spread for name in ("lane_change_gap", "lane_change_duration", "braking"))
    assert gap.below(10.0) == pytest.approx(0.68, abs=0.01)
    assert duration.below(0.7) == pytest.approx(1 / 5609, rel=0.2)
    assert duration.above(12.4) == pytest.approx(1 / 5609, rel=0.2)
    assert braking.median * math.exp(braking.deviation**2 / 2) == pytest.approx(3.27, abs=0.01)
    assert FEATURES["speeding"].spread.above(10 * 0.44704) == pytest.approx(0.06, abs=0.005)
    assert FEATURES["junction_gap"].spread.below(8.25) == pytest.approx(0.85, abs=0.005)
    assert FEATURES["lane_change_headway"].spread.below(0.5) == pytest.approx(0.12, abs=0.005)


def test_a_tail_by_points_is_log_linear_and_goes_on_beyond_the_last():
    tail = UpperTail((0.0, 2.0, 4.0), (1.0, 0.1, 0.001))
    assert tail.above(-1.0) == 1.0
    assert tail.above(1.0) == pytest.approx(math.sqrt(0.1))
    assert tail.above(3.0) == pytest.approx(0.01)
    assert tail.above(6.0) == pytest.approx(1e-5)


def test_nothing_is_called_rarer_than_the_least():
    assert tail_probability(FEATURES["lane_change_gap"], FEATURES["lane_change_gap"].spread, 0.0) == LEAST
    assert tail_probability(FEATURES["braking"], FEATURES["braking"].spread, 30.0) == LEAST


@pytest.mark.parametrize("feature", FEATURES.values(), ids=lambda feature: feature.name)
def test_every_row_states_unit_source_and_share(feature: RoadUserFeature):
    assert all((feature.unit, feature.source, feature.per))
    assert "1.5" in feature.words.format(value=1.5) or "2" in feature.words.format(value=1.5)
