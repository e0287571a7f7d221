import math

import pytest

from risk_sac.config import Interval, Odd
from risk_sac.records import Outcome
from risk_sac.report.evidence.coverage import axis_of, coverage, kinds
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.odd import narrow
from risk_sac.scenario.space import Parameter
from tests.builders import collision, episode_record, judgement

MIXED = FAMILIES["mixed"]
LOWEST = {parameter.name: parameter.low for parameter in MIXED.space.parameters}


def scene(outcome=Outcome.SAFE, contact=None, **values):
    return episode_record(0, outcome, scene=LOWEST | values, collision=contact)


def of(found, name):
    return next(each for each in found.parameters if each.name == name)


def test_a_bin_holds_its_lower_edge_and_the_last_one_both():
    length = Parameter("length_m", "m", 0, 10, "a length")
    axis = axis_of(length, length, 5)
    assert axis.names == ("0 to 2", "2 to 4", "4 to 6", "6 to 8", "8 to 10")
    assert axis.places([0.0, 1.999, 2.0, 7.9, 8.0, 10.0]).tolist() == [0, 0, 1, 3, 4, 4]
    fixed = Parameter("length_m", "m", 3, 3, "a length")
    assert axis_of(fixed, length, 5).names == ("3",)
    assert axis_of(fixed, length, 5).places([3.0]).tolist() == [0]


@pytest.mark.parametrize(
    ("allowed", "names"),
    [(None, ("zebra", "signalised")), (("zebra",), ("zebra",)), (("signalised",), ("signalised",))],
)
def test_a_category_is_a_bin_and_one_that_the_odd_excludes_is_none(allowed, names):
    odd = Odd.model_validate({"scenery": {"crossing_types": allowed}})
    whole, bounded = MIXED.space.parameters[0], narrow(MIXED.space, odd).parameters[0]
    axis = axis_of(bounded, whole, 10)
    assert axis.names == names
    if allowed is None:
        assert axis.places([0.0, math.nextafter(0.5, 0.0), 0.5, 1.0]).tolist() == [0, 0, 1, 1]


def test_what_was_played_failed_and_refused_in_each_bin_and_what_never_was():
    failed = scene(Outcome.FAILURE, collision(judgement=judgement()), crossing=0.7, friction=0.99)
    found = coverage(MIXED, Odd(), [scene(), scene(), failed, scene(Outcome.REJECTED, friction=0.8)])
    assert found.episodes == 3
    friction = of(found, "friction")
    assert [(each.played, each.failed, each.refused) for each in friction.bins if each.played or each.refused] == [
        (2, 0, 0),
        (0, 0, 1),
        (1, 1, 0),
    ]
    assert len(friction.never) == 8
    assert "0.8 to 0.84" in friction.never  # what is refused has not been looked at
    crossing = of(found, "crossing")
    assert crossing.categorical
    assert [(each.name, each.played, each.failed) for each in crossing.bins] == [("zebra", 2, 0), ("signalised", 1, 1)]


def test_bins_follow_the_odd_and_what_it_allows_beyond_scenes_is_named():
    odd = Odd.model_validate({"environment": {"friction": {"low": 0.8, "high": 0.9}}})
    found = coverage(MIXED, odd, [])
    assert (of(found, "friction").low, of(found, "friction").high) == (0.8, 0.9)
    assert "ego_speed_mps from 0 to 6 m/s" in found.beyond  # scenes begin at 6 m/s or faster
    assert "environment.visibility_m" in found.fixed
    assert "environment.friction" not in found.fixed
    assert MIXED.odd.dynamic.ego_speed_mps == Interval(low=0, high=13.89)


def test_cells_that_were_hit_are_in_words_and_values_that_never_were_are_named():
    contact = collision(judgement=judgement())
    found = kinds([contact, contact, None, collision(verdicts={"ego_moving": False}, judgement=judgement())])
    assert list(found.hit.values()) == [2]
    assert found.values["striker"]["vehicle (adversary)"] == 2
    assert "pedestrian (background)" in found.never
    assert "vehicle (adversary)" not in found.never
    assert all(name.startswith("vehicle (adversary), the ego") for name in found.hit)
