import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic_core import from_json

from risk_sac.config import CampaignSpec
from risk_sac.metrics import MetricsAccumulator
from risk_sac.records import Grade, Outcome, stored
from service.store.stored import PlainEpisode
from service.views.curves import curves, spread
from tests.builders import collision, episode_record, judgement, violation

SPEC = CampaignSpec(families=("low",), methods=("random",), seeds=(3, 4))


def plain(run, record):
    return PlainEpisode(1, run.number, record.phase, record.index, record.outcome, from_json(stored(record)))


def drawn(count):
    """Records of a search: half of them contacts of several kinds, some with or after a violation without contact."""
    dice = random.Random(5)
    for index in range(count):
        outcome = dice.choice([Outcome.SAFE, Outcome.REJECTED, Outcome.FAILURE, Outcome.FAILURE, Outcome.DEGENERATE])
        grade = dice.choice(list(Grade)) if outcome is Outcome.FAILURE else None
        hit = collision(
            ego_speed_mps=dice.choice([5.0, 15.0]), judgement=judgement(grade, signature=dice.choice("abcdefgh"))
        )
        touched = outcome in (Outcome.FAILURE, Outcome.DEGENERATE)
        if outcome is Outcome.DEGENERATE:
            hit = hit.model_copy(update={"verdicts": {"ego_moving": False}})
        more = {"mean_cost": dice.random(), "dual_variable": dice.random()}
        if outcome is Outcome.FAILURE and dice.random() < 0.4:
            more["violations"] = (violation(grade=dice.choice(list(Grade)), signature=dice.choice("abcd")),)
            touched = dice.random() < 0.5
        yield episode_record(index, outcome, collision=hit if touched else None, **more)


def test_curves_are_what_the_metrics_of_the_run_were_at_each_point(ledger):
    campaign = ledger.create(SPEC)
    records = list(drawn(250))
    told, accumulator = [], MetricsAccumulator(horizon_steps=200)
    for record in records:
        told.append(accumulator.add(record))
    found, empty = curves(campaign, [plain(campaign.runs[0], each) for each in records], 40).runs
    assert len(found.episodes) == 40
    assert found.episodes[-1] == 250
    at = [told[count - 1] for count in found.episodes]
    for name in ("window_ecr", "window_pcr", "preventable", "distinct_preventable", "dual_variable"):
        assert getattr(found, name) == pytest.approx([getattr(each, name) for each in at]), name
    assert found.distinct == [each.distinct_failures for each in at]
    assert found.distinct[-1] > found.distinct_preventable[-1] > 3
    assert (found.run_id, found.family, found.method, found.seed) == ("low-random-3", "low", "random", 3)
    assert [value for _, value in empty if isinstance(value, list)] == [[]] * 8


@given(count=st.integers(1, 3000), points=st.integers(1, 1000))
def test_points_are_evenly_spread_and_the_newest_is_one(count, points):
    at = spread(count, points).tolist()
    assert len(at) == min(count, points)
    assert at[-1] == count
    gaps = [later - earlier for earlier, later in zip([0, *at], at, strict=False)]
    assert min(gaps) >= 1
    assert max(gaps) - min(gaps) <= 1
