"""The ego's reaction to its striker, as facts; also mirrored."""

from dataclasses import replace

import numpy as np
import pytest

from risk_sac.records import EgoPart
from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.fault import ego_part
from tests.unit.verdicts.staged import (
    CAR_M,
    STREET,
    WALKING,
    crossing_car,
    cut_in,
    leader_brakes,
    merge,
    mirrored,
    pedestrian_crosses,
    stage,
    straight,
)


def part(evidence: Evidence, yields: str | None = None) -> EgoPart:
    found, mirror = (ego_part(each, 1, find_conflict(each, 1), yields) for each in (evidence, mirrored(evidence)))
    assert found == mirror
    return found


@pytest.mark.parametrize(
    ("changes", "after_s", "braking"),
    [((), None, 0.0), (((4.0, -3.0),), 1.1, 3.0), (((4.0, -1.0),), None, 1.0), (((2.0, -2.0),), 0.0, 2.0)],
)
def test_when_and_how_hard_it_braked(changes, after_s, braking):
    found = part(stage(straight(0.0, 0.0, 0.0, 12.0, *changes), straight(80.0, 0.0, 0.0, 0.0)))
    assert found.braked_after_s == (None if after_s is None else pytest.approx(after_s, abs=0.25))
    assert found.braking_mps2 == pytest.approx(braking, abs=0.01)


@pytest.mark.parametrize(("after_s", "gained"), [(0.1, 0.0), (1.2, 2.0)])
def test_what_it_gained_within_its_response_time_does_not_count(after_s, gained):
    since_s = 1.5 + after_s  # the conflict begins when the bodies would touch within 4 s
    ego = straight(0.0, 0.0, 0.0, 10.0, (since_s, 2.0), (since_s + 1.0, 0.0))
    evidence = stage(ego, straight(72.0, 0.0, 0.0, 0.0), kinds=WALKING)
    assert find_conflict(evidence, 1).time_s == pytest.approx(1.5, abs=0.11)
    assert part(evidence).gained_mps == pytest.approx(gained, abs=0.2)


@pytest.mark.parametrize(("y", "near"), [(1.5, True), (2.9, True), (4.0, False)])
def test_it_is_aware_of_a_pedestrian_on_the_carriageway_beside_its_way(y, near):
    ego = straight(0.0, 0.0, 0.0, 6.0, (2.0, 1.0))
    touches_s = next(t / 10 for t in range(200) if ego(t / 10)[0] + CAR_M[0] / 2 >= 40.0)
    aside = y - CAR_M[1] / 2
    walker = straight(40.0, y, -np.pi / 2, aside / 0.5, start_s=touches_s - 0.5)
    found = part(
        stage(ego, lambda t: walker(max(t, touches_s - 0.5)), kinds=WALKING, ground=replace(STREET, crossings=()))
    )
    assert found.sped_up == near


@pytest.mark.parametrize(
    ("evidence", "yields", "left"),
    [
        (cut_in(gap=-3.0, ego=12.0, other=12.0), None, "striker"),  # it goes on moving over
        (merge(), "ego", "ego"),
        (cut_in(gap=25.0, ego=14.0, other=8.0), None, "ego"),  # in the lane long before, and the ego does not brake
        (leader_brakes(braking=8.0), "ego", "striker"),  # harder than 6 m/s²
        (leader_brakes(braking=4.0), "ego", "ego"),
        (pedestrian_crosses(), "ego", "ego"),
        (pedestrian_crosses(), "striker", "striker"),
        (crossing_car(), "striker", "striker"),
        (crossing_car(), "ego", "ego"),
        (crossing_car(), None, None),  # at the same time
    ],
)
def test_which_left_the_proper_response_first(evidence, yields, left):
    assert part(evidence, yields).left_first == left
