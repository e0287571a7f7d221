import math
from dataclasses import replace

import pytest

from risk_sac.types import Kind, Role
from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.endangering import endangered_ego
from risk_sac.verdicts.evidence import Evidence
from tests.unit.verdicts.staged import (
    CAR_M,
    LANE_M,
    WALKING,
    Motion,
    crossing_car,
    cut_in,
    merge,
    mirrored,
    pedestrian_crosses,
    sideways,
    stage,
    straight,
)


def named(evidence: Evidence) -> tuple[str, ...]:
    found, again = (endangered_ego(each, 1, find_conflict(each, 1)) for each in (evidence, mirrored(evidence)))
    assert found == again
    return found


@pytest.mark.parametrize(
    ("evidence", "expected"),
    [
        (cut_in(gap=-3.0, ego=12.0, other=12.0), ("unsafe_lane_change",)),  # beside the ego
        (cut_in(gap=6.0, ego=14.0, other=9.0), ("unsafe_lane_change",)),  # ahead, and far too near
        (cut_in(gap=40.0, ego=14.0, other=9.0), ()),  # R157's driver would brake in time
        (merge(), ()),  # the ego came over
        (crossing_car(), ()),
        (pedestrian_crosses(), ()),
    ],
)
def test_a_lane_change_without_room(evidence: Evidence, expected: tuple[str, ...]) -> None:
    assert named(evidence) == expected


def led(braking: float, *others: Motion, kinds: tuple[Kind, ...] = ()) -> Evidence:
    """The leader, 10 m ahead, brakes; others are there too."""
    ego, leader = straight(0.0, 0.0, 0.0, 14.0), straight(CAR_M[0] + 10.0, 0.0, 0.0, 14.0, (2.0, -braking))
    return stage(ego, leader, *others, kinds=(Kind.VEHICLE, Kind.VEHICLE, *kinds))


CHECKS = ("brake_check",)


@pytest.mark.parametrize(
    ("ahead_m", "y_m", "kind", "expected"),
    [
        (20.0, 0.0, Kind.VEHICLE, ()),
        (60.0, 0.0, Kind.VEHICLE, CHECKS),
        (20.0, LANE_M, Kind.VEHICLE, CHECKS),  # in the lane beside
        (-30.0, 0.0, Kind.VEHICLE, CHECKS),  # behind the ego
        (20.0, 1.8, Kind.PEDESTRIAN, ()),
        (20.0, 5.0, Kind.PEDESTRIAN, CHECKS),
    ],
)
def test_a_leader_that_brakes_for_nobody(ahead_m: float, y_m: float, kind: Kind, expected: tuple[str, ...]) -> None:
    other = straight(CAR_M[0] + 10.0 + ahead_m, y_m, 0.0, 14.0)
    assert named(led(8.0)) == CHECKS
    assert named(led(8.0, other, kinds=(kind,))) == expected


def test_who_brakes_gently_or_for_a_signal_checks_nobody() -> None:
    assert named(led(3.9)) == ()
    hard = led(8.0)
    for letter, expected in (("r", ()), ("y", ()), ("G", CHECKS)):
        link = hard.link.copy()
        link[:, 1] = ord(letter)
        assert named(replace(hard, link=link)) == expected
    assert named(replace(hard, role=hard.role.clip(max=Role.BACKGROUND) * [1, 0] + [0, Role.BACKGROUND])) == ()


def walks(x_m: float, y_m: float, turn_rad: float, at_s: float) -> Motion:
    """Along the kerb towards the ego, and from `at_s` on to its right by `turn_rad`."""
    along = straight(x_m, y_m, math.pi, 1.4)
    return lambda t: along(t) if t < at_s else straight(*along(at_s)[:2], math.pi + turn_rad, 1.4, start_s=at_s)(t)


def test_a_pedestrian_that_turns_into_the_way() -> None:
    ego, walker = straight(0.0, 0.0, 0.0, 8.0), walks(50.0, 3.2, math.pi / 2, 2.5)
    seen, unseen = stage(ego, walker, kinds=WALKING), stage(ego, walker, kinds=WALKING, seen_from_s=2.7)
    assert named(seen) == ("turned_into_path",)
    assert named(unseen) == ()  # it could not see the ego when it turned


@pytest.mark.parametrize(
    ("ahead_m", "expected"),
    [
        (-1.0, CHECKS),  # it has come over before the ego, and then brakes
        (-7.0, ("unsafe_lane_change",)),  # it touches the ego while it comes over
    ],
)
def test_a_vehicle_that_comes_over_and_brakes(ahead_m: float, expected: tuple[str, ...]) -> None:
    beside = sideways(straight(ahead_m, LANE_M, 0.0, 12.0, (2.5, -6.0)), 2.0, -1.2, LANE_M)
    assert named(stage(straight(0.0, 0.0, 0.0, 9.0), beside)) == expected
