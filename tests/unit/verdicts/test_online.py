"""Conflict at a moment: by hand, mirrored, and as in the record."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.course import polyline
from risk_sac.verdicts.evidence import PER_ACTOR
from risk_sac.verdicts.online import conflicts_now
from risk_sac.world.types import Frame, Kind
from tests.builders import frame_of, moved
from tests.unit.verdicts.staged import LANE_M, STREET, cut_in, leader_brakes, pedestrian_crosses

Actor = tuple[float, float, float, float, Kind]  # x, y, heading, speed, kind
CAR, WALKER = Kind.VEHICLE, Kind.PEDESTRIAN
AHEAD = polyline(np.array([0.0, 200.0]), np.zeros(2))


def frame(*others: Actor, ego: float = 12.0, mirror: int = 1, **changes: Any) -> Frame:
    x, y, heading, speed, kinds = zip((0.0, 0.0, 0.0, ego, CAR), *others, strict=True)
    return frame_of(
        kinds, x_m=x, y_m=mirror * np.array(y), heading_rad=mirror * np.array(heading), speed_mps=speed, **changes
    )


def in_conflict(now: Frame, known: bool = True) -> bool:
    found = conflicts_now(now, AHEAD, np.full(len(now.ids), known), STREET)
    assert not found[0]
    return bool(found[1])


@pytest.mark.parametrize("mirror", [1, -1])
@pytest.mark.parametrize(
    ("other", "expected"),
    [
        pytest.param((27.0, 0.0, 0.0, 0.0, CAR), True, id="a standing leader, 1.9 s"),
        pytest.param((32.0, 0.0, 0.0, 0.0, CAR), False, id="a standing leader, 2.3 s"),
        pytest.param((15.0, 0.0, 0.0, 12.0, CAR), False, id="a leader as fast"),
        pytest.param((-15.0, 0.0, 0.0, 20.0, CAR), False, id="a follower"),
        pytest.param((10.0, LANE_M, 0.0, 5.0, CAR), False, id="a slow neighbour"),
        pytest.param((30.0, LANE_M, math.pi, 12.0, CAR), False, id="oncoming in its lane"),
        pytest.param((60.0, 0.0, math.pi, 12.0, CAR), True, id="oncoming in the ego's"),
        pytest.param((36.0, -36.0, math.pi / 2, 12.0, CAR), True, id="crossing at the same time"),
        pytest.param((36.0, -80.0, math.pi / 2, 12.0, CAR), False, id="crossing long after"),
        pytest.param((36.0, 5.0, -math.pi / 2, 1.4, WALKER), True, id="a pedestrian before the ego"),
        pytest.param((36.0, 5.0, math.pi / 2, 1.4, WALKER), False, id="a pedestrian that walks off"),
        pytest.param((36.0, 8.1, -math.pi / 2, 1.4, WALKER), False, id="a pedestrian that comes too late"),
        pytest.param((36.0, 8.5, 0.0, 0.0, WALKER), False, id="a pedestrian on the sidewalk"),
        pytest.param((36.0, 1.1, 0.0, 0.0, WALKER), True, id="a pedestrian within the corridor"),
        pytest.param((36.0, 1.6, 0.0, 0.0, WALKER), False, id="a pedestrian beside the corridor"),
    ],
)
def test_who_is_in_conflict(other, expected, mirror):
    assert in_conflict(frame(other, mirror=mirror)) is expected
    assert not in_conflict(frame(other, mirror=mirror), known=False)


def test_a_leader_that_brakes_hard():
    leader = (30.0, 0.0, 0.0, 12.0, CAR)
    assert in_conflict(frame(leader, accel_mps2=np.array([0.0, -5.5])))
    assert not in_conflict(frame(leader, accel_mps2=np.array([0.0, -4.5])))


@pytest.mark.parametrize("mirror", [1, -1])
def test_a_neighbour_that_comes_over(mirror):
    now = frame((12.0, 2.8, 0.0, 7.0, CAR), mirror=mirror)  # its side is 0.225 m from the marking
    comes = moved(now, lane_offset_m=[0.0, mirror * -0.5])
    assert in_conflict(moved(comes, vy_mps=np.array([0.0, mirror * -0.3])))
    assert not in_conflict(moved(comes, vy_mps=np.array([0.0, mirror * -0.2])))
    assert in_conflict(moved(now, y_m=now.y_m * 2.5 / 2.8, lane_offset_m=[0.0, mirror * -0.8]))  # over the marking
    assert not in_conflict(moved(now, y_m=now.y_m * 3.0 / 2.8, lane_offset_m=[0.0, mirror * -0.3]))


@pytest.mark.parametrize(("letter", "expected"), [("r", False), ("g", False), ("G", True), ("", True)])
def test_who_has_to_stop_and_can_is_expected_to(letter, expected):
    link = np.array([0, ord(letter) if letter else 0], dtype=np.uint8)
    assert in_conflict(frame((36.0, -36.0, math.pi / 2, 12.0, CAR), link=link)) is expected
    near = frame((20.0, -20.0, math.pi / 2, 12.0, CAR), link=link)  # needs 21 m, and has 16.4
    assert in_conflict(near)


def test_the_path_ahead_decides():
    walker = (20.0, 20.0, 0.0, 0.0, WALKER)
    bend = polyline(np.array([0.0, 20.0, 20.0]), np.array([0.0, 0.0, 50.0]))
    now, ground = frame(walker), replace(STREET, roadway=())
    assert not conflicts_now(now, AHEAD, np.ones(2, bool), ground)[1]
    assert conflicts_now(now, bend, np.ones(2, bool), ground)[1]


@pytest.mark.parametrize("evidence", [leader_brakes(), cut_in(), cut_in(gap=5.0), pedestrian_crosses()])
def test_a_record_begins_where_it_would_have_been_seen(evidence):
    began = find_conflict(evidence, 1).frame
    e = evidence

    def at(t):
        link = e.link[t].astype(np.uint8)
        state = {name: getattr(e, name)[t] for name in PER_ACTOR}
        sizes = {"length_m": e.length_m, "width_m": e.width_m}
        now = frame_of(list(e.kind), time_s=float(e.time_s[t]), ids=e.ids, link=link, **state, **sizes)
        path = polyline(e.x_m[t, 0] + np.array([0.0, 200.0]), e.y_m[t, 0] + np.zeros(2))
        return bool(conflicts_now(now, path, e.known[t], e.ground)[1])

    assert at(began)
    assert not at(began - 1)
