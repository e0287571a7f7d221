import math
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.records import ConflictType
from risk_sac.scenario.layout import Area
from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.evidence import Evidence, Ground
from risk_sac.verdicts.offences import ego_offences, striker_offences
from risk_sac.world.types import Kind
from tests.unit.verdicts.staged import (
    STREET,
    WALKING,
    Motion,
    crossing_car,
    mirrored,
    pedestrian_crosses,
    sideways,
    stage,
    straight,
)

JUNCTION = (Area.box(45.0, 75.0, -15.0, 15.0),)


def crosses(evidence: Evidence) -> bool:
    return find_conflict(evidence, 1).type is ConflictType.CROSSING


def labels(evidence: Evidence) -> tuple[str, ...]:
    found, again = (striker_offences(each, 1, crossing=crosses(each)) for each in (evidence, mirrored(evidence)))
    assert found == again
    return found


def of_ego(evidence: Evidence) -> tuple[str, ...]:
    found, again = (ego_offences(each, 1, crossing=crosses(each)) for each in (evidence, mirrored(evidence)))
    assert found == again
    return found


def with_links(evidence: Evidence, ego: list[tuple[float, str]], other: list[tuple[float, str]]) -> Evidence:
    """Links from these times on; "" for none."""
    link = np.zeros_like(evidence.link)
    for column, changes in enumerate((ego, other)):
        for since, letter in changes:
            link[evidence.time_s >= since - 1e-9, column] = ord(letter) if letter else 0
    return replace(evidence, link=link, ground=replace(evidence.ground, junctions=JUNCTION))


def crossing(ego: list[tuple[float, str]], other: list[tuple[float, str]]) -> Evidence:
    return with_links(crossing_car(), ego, other)  # at 12 m/s, contact at 4.7 s, 15 m before at 3.5 s


GREEN = [(0.0, "G"), (3.5, "")]


@pytest.mark.parametrize(
    ("link", "expected"),
    [
        ([(0.0, "r"), (3.5, "")], ("red_light",)),
        ([(0.0, "G"), (2.0, "r"), (3.5, "")], ("red_light",)),
        ([(0.0, "u"), (3.5, "")], ("red_light",)),
        ([(0.0, "y"), (3.5, "")], ()),
        ([(0.0, "r"), (3.0, "G"), (3.5, "")], ()),  # it turned green before
        ([(0.0, "r"), (3.6, "G")], ("red_light",)),  # the next junction's, once in this one
        ([(0.0, "g"), (3.5, "")], ("priority",)),
        ([(0.0, "G"), (3.5, "")], ()),
        ([], ()),
    ],
)
def test_what_crossing_traffic_passed_its_stop_line_on(link, expected):
    assert labels(crossing(GREEN, link)) == expected


def dawdles(out_of_it: bool) -> Evidence:
    """The ego passes its stop line on red, then creeps 9 s.

    `out_of_it`: the junction ends 9 m before the ego.
    """
    creeping = straight(60.0, -20.0, math.pi / 2, 10.0, (1.0, -10.0), (1.92, 0.0), start_s=0.0)
    evidence = stage(straight(0.0, 0.0, 0.0, 5.6, start_s=0.0), creeping, from_s=0.0, until_s=20.0)
    evidence = with_links(evidence, GREEN, [(0.0, "r"), (1.2, "")])
    if out_of_it:
        evidence = replace(evidence, ground=replace(evidence.ground, junctions=(Area.box(45.0, 75.0, -15.0, -9.0),)))
    return evidence


def test_a_striker_on_red_stays_on_red_until_it_has_left_the_junction():
    assert dawdles(False).time_s[-1] > 8.0
    assert labels(dawdles(False)) == ("red_light",)
    assert labels(dawdles(True)) == ()


@pytest.mark.parametrize(("release_x_m", "expected"), [(20.0, ()), (0.0, ("red_light",))])
def test_a_red_light_before_which_the_ego_could_not_stop_at_the_release_is_no_offence(release_x_m, expected):
    """The line is at 45 m; stopping at leisure takes 30 m."""
    ego = straight(release_x_m, 0.0, 0.0, 12.0, start_s=0.0)
    evidence = stage(ego, straight(60.0, 0.0, 0.0, 2.0, start_s=0.0), from_s=0.0)
    passes_s = (45.0 - 2.3 - release_x_m) / 12.0
    assert of_ego(with_links(evidence, [(0.0, "r"), (passes_s + 0.1, "")], [])) == expected


@pytest.mark.parametrize(("braking", "expected"), [(2.5, ()), (0.0, ("speeding",))])
def test_a_speed_that_the_ego_inherited_is_no_offence_while_it_slows_down(braking, expected):
    ego = straight(0.0, 0.0, 0.0, 17.0, (0.5, -braking), start_s=0.0)
    assert of_ego(stage(ego, straight(44.0, 0.0, 0.0, 0.0, start_s=0.0), from_s=0.0)) == expected


@pytest.mark.parametrize("ego", [[(0.0, "g"), (3.5, "")], [(0.0, "r"), (3.5, "")], [], [(0.0, "r"), (3.8, "G")]])
def test_priority_takes_an_ego_that_had_it(ego):
    assert labels(crossing(ego, [(0.0, "g"), (3.5, "")])) == ()


@pytest.mark.parametrize(("speed", "expected"), [(13.89 * 1.09, ()), (13.89 * 1.11, ("speeding",))])
def test_more_than_ten_percent_over_the_limit_is_speeding(speed, expected):
    assert labels(crossing_car(other=speed)) == expected


def test_a_vehicle_that_goes_backwards_is_in_the_wrong_direction():
    head_on = stage(straight(0.0, 0.0, 0.0, 8.0), straight(60.0, 0.0, np.pi, 8.0))
    assert labels(head_on) == ()
    assert labels(replace(head_on, heading_rad=np.zeros_like(head_on.heading_rad))) == ("wrong_direction",)


@pytest.mark.parametrize(
    ("link", "expected"),
    [
        ([(0.0, "r")], ("pedestrian_on_red",)),
        ([(0.0, "G")], ()),
        ([(0.0, "r"), (3.0, "G")], ()),  # waited for green
        ([(0.0, "G"), (6.0, "r")], ()),  # caught by red half way
        ([], ()),
    ],
)
def test_a_pedestrian_is_judged_by_the_light_it_stepped_out_on(link, expected):
    assert labels(with_links(pedestrian_crosses(), [], link)) == expected  # at the kerb at 3.4 s


@pytest.mark.parametrize(
    ("ego", "other", "expected"),
    [
        ([(0.0, "r"), (3.5, "")], GREEN, ("red_light",)),
        ([(0.0, "y"), (3.5, "")], GREEN, ()),
        ([(0.0, "r"), (3.0, "g"), (3.5, "")], GREEN, ("priority",)),  # it turned green before, but it has to yield
        ([(0.0, "g"), (3.5, "")], [(0.0, "g"), (3.5, "")], ()),
        ([(0.0, "g"), (3.5, "")], [(0.0, "r"), (3.5, "")], ()),
        (GREEN, GREEN, ()),
    ],
)
def test_what_the_ego_passed_its_stop_line_on(ego, other, expected):
    assert of_ego(crossing(ego, other)) == expected


@pytest.mark.parametrize(
    ("link", "expected"),
    [([], ("priority",)), ([(0.0, "G")], ("priority",)), ([(0.0, "r")], ())],
    ids=["zebra", "on green", "on red"],
)
def test_a_pedestrian_on_a_crossing_has_priority_unless_it_stepped_out_on_red(link, expected):
    assert of_ego(with_links(pedestrian_crosses(), [], link)) == expected
    elsewhere = with_links(pedestrian_crosses(), [], link)
    assert of_ego(replace(elsewhere, ground=replace(STREET, crossings=()))) == ()


def test_a_pedestrian_that_walks_into_an_ego_on_the_crossing_has_lost_nothing():
    ego, walker = straight(96.0, 0.0, 0.0, 2.0, start_s=0.0), straight(100.0, 8.0, -np.pi / 2, 2.6, start_s=0.0)
    evidence = stage(ego, walker, kinds=WALKING, from_s=0.0)
    assert evidence.x_m[-1, 0] > 99.0
    assert of_ego(evidence) == ()


def on_two_way_road(moved_m: float, *others: Motion, until_s: float = 6.0) -> tuple[str, ...]:
    """Offences of an ego that moves across a two-way road's lanes."""
    ego = sideways(straight(100.0, -1.65, 0.0, 12.0), 0.0, math.copysign(3.0, moved_m), moved_m)
    far = straight(280.0, -4.95, 0.0, 12.0)
    ground = Ground(net="mixed/mixed.net.xml")
    kinds = (Kind.VEHICLE,) * (2 + len(others))
    return ego_offences(stage(ego, far, *others, kinds=kinds, ground=ground, until_s=until_s, contact=False))


@pytest.mark.parametrize(
    ("moved_m", "expected"),
    [(0.01, ()), (-3.3, ()), (1.6, ()), (3.3, ("wrong_direction",)), (13.2, ("off_road",)), (-9.9, ("off_road",))],
    ids=["stays", "changes lanes", "over the line", "oncoming lane", "beyond it", "ditch"],
)
def test_an_ego_beside_its_carriageway_is_off_the_road_or_in_oncoming_traffic(moved_m, expected):
    assert on_two_way_road(moved_m, until_s=9.0) == expected


def test_an_ego_that_overtakes_may_use_the_oncoming_lane():
    assert on_two_way_road(3.3, straight(160.0, -1.65, 0.0, 4.0)) == ()


def test_an_ego_that_came_back_three_seconds_ago_has_broken_nothing():
    away = sideways(straight(100.0, -1.65, 0.0, 12.0), 0.0, 3.0, 3.3)
    back = sideways(away, 2.0, -3.0, 3.3)
    ground = Ground(net="mixed/mixed.net.xml")
    far = straight(280.0, -4.95, 0.0, 12.0)
    found = [
        ego_offences(stage(back, far, ground=ground, until_s=until_s, contact=False)) for until_s in (2.0, 4.0, 6.5)
    ]
    assert found == [("wrong_direction",), ("wrong_direction",), ()]
