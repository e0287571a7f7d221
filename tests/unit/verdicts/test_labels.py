from dataclasses import replace

import numpy as np
import pytest

from risk_sac.scenario.ground import Area
from risk_sac.types import Kind
from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.labels import broken
from tests.unit.verdicts.staged import (
    STREET,
    crossing_car,
    cut_in,
    leader_brakes,
    mirrored,
    pedestrian_crosses,
    stage,
    straight,
)

JUNCTION = (Area.box(45.0, 75.0, -15.0, 15.0),)


def labels(evidence: Evidence) -> tuple[str, ...]:
    found, again = (broken(each, 1, find_conflict(each, 1)) for each in (evidence, mirrored(evidence)))
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
def test_what_crossing_traffic_passed_its_stop_line_on(
    link: list[tuple[float, str]], expected: tuple[str, ...]
) -> None:
    assert labels(crossing(GREEN, link)) == expected


@pytest.mark.parametrize("ego", [[(0.0, "g"), (3.5, "")], [(0.0, "r"), (3.5, "")], []])
def test_priority_takes_an_ego_that_had_it(ego: list[tuple[float, str]]) -> None:
    assert labels(crossing(ego, [(0.0, "g"), (3.5, "")])) == ()


def test_a_red_light_long_ago_is_another_story() -> None:
    evidence = stage(straight(0.0, 0.0, 0.0, 10.0), straight(150.0, 0.0, 0.0, 2.0), until_s=19.0)
    assert labels(with_links(evidence, [], [(-1.5, "r"), (1.0, "")])) == ()


def test_who_stands_at_a_signal_that_is_switched_off_passed_nothing() -> None:
    evidence = stage(straight(0.0, 0.0, 0.0, 10.0), straight(50.0, 0.0, 0.0, 0.0))
    assert labels(with_links(evidence, [], [(-1.5, "r"), (1.0, "")])) == ()


@pytest.mark.parametrize(("speed", "expected"), [(13.89 * 1.09, ()), (13.89 * 1.11, ("speeding",))])
def test_more_than_ten_percent_over_the_limit_is_speeding(speed: float, expected: tuple[str, ...]) -> None:
    assert labels(crossing_car(other=speed)) == expected


def test_who_has_braked_down_three_seconds_ago_does_not_speed() -> None:
    striker = straight(40.0, 0.0, 0.0, 17.0, (-1.5, -8.0))
    assert labels(stage(straight(0.0, 0.0, 0.0, 10.0), striker)) == ()


def test_a_vehicle_that_goes_backwards_is_in_the_wrong_direction() -> None:
    head_on = stage(straight(0.0, 0.0, 0.0, 8.0), straight(60.0, 0.0, np.pi, 8.0))
    assert labels(head_on) == ()
    assert labels(replace(head_on, heading_rad=np.zeros_like(head_on.heading_rad))) == ("wrong_direction",)


@pytest.mark.parametrize("evidence", [cut_in(), leader_brakes()])
def test_nothing_broken(evidence: Evidence) -> None:
    assert labels(evidence) == ()


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
def test_a_pedestrian_is_judged_by_the_light_it_stepped_out_on(
    link: list[tuple[float, str]], expected: tuple[str, ...]
) -> None:
    assert labels(with_links(pedestrian_crosses(), [], link)) == expected  # at the kerb at 3.4 s


def test_off_a_crossing_no_light_tells_a_pedestrian_anything() -> None:
    evidence = with_links(pedestrian_crosses(), [], [(0.0, "r")])
    assert evidence.kind[1] == Kind.PEDESTRIAN
    assert labels(replace(evidence, ground=replace(STREET, crossings=()))) == ()
