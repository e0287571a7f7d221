"""Conditions with their rules, edges and delays, against values computed by hand."""

import math
from typing import Any

import pytest

from risk_sac.scenario.layout import Reach, StoryPlan
from risk_sac.scenario.places import StoryPlaces
from risk_sac.scenario.space import Value
from risk_sac.scenario.travel_line import Pose
from risk_sac.sim.story.cast import Present
from risk_sac.sim.story.stage import Stage
from risk_sac.sim.story.triggers import Watch
from risk_sac.world.types import STEP_S
from tests.unit.sim.story.straight import CAR, POINT, condition, story_of, straight_net

PLACE = {"kind": "world", "x_m": 3.0, "y_m": 4.0, "heading_rad": 0.0}


class NoBoard:
    def is_in(self, condition: object) -> bool:
        return False


def stage_of(**present: Present) -> Stage:
    story = story_of(variables={"count": 2.0}, words={"mode": "fast"})
    places = StoryPlaces(straight_net(), None, story, Value({}, {}))
    plan = StoryPlan(story=story, actors={}, places=places, numbers={"braking": 1.0}, words={"body": "van"})
    stage = Stage(plan)
    stage.look(present)
    return stage


def at(
    x_m: float, y_m: float = 0.0, speed_mps: float = 0.0, heading: float = 0.0, reach: Reach = POINT, accel: float = 0.0
) -> Present:
    return Present.moving(Pose(x_m, y_m, heading), speed_mps, accel, reach)


def value_of(stage: Stage, **fields: Any) -> float:
    """Finds by bisection the value that the first actor's condition compares."""
    low, high = -1000.0, 1000.0
    for _ in range(60):
        middle = (low + high) / 2
        greater = condition(of=["one"], rule="greater", value=middle, **fields)
        low, high = (middle, high) if Watch(greater).check(stage, NoBoard())[0] else (low, middle)
    return low


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("along", "freespace", "wanted"),
    [
        ("longitudinal", False, 30.0),
        ("longitudinal", True, 30.0 - 3.0 - 1.0),  # own front is 3 m ahead of the reference, its rear 1 m behind
        ("lateral", False, 4.0),
        ("lateral", True, 2.0),
        ("euclidean", False, math.hypot(30.0, 4.0)),
        ("euclidean", True, math.hypot(26.0, 2.0)),
    ],
)
def test_distances_of_actors(side: int, along: str, freespace: bool, wanted: float) -> None:
    stage = stage_of(one=at(0, 0, reach=CAR), other=at(30, side * 4.0, reach=CAR))
    found = value_of(stage, kind="distance", to="other", along=along, freespace=freespace)
    assert found == pytest.approx(wanted, abs=1e-4)


@pytest.mark.parametrize("coordinates", ["entity", "lane", "road"])
def test_distance_to_an_actor_behind_is_positive(coordinates: str) -> None:
    stage = stage_of(one=at(100, reach=CAR), other=at(60, reach=CAR))
    fields = {"kind": "distance", "to": "other", "along": "longitudinal", "coordinates": coordinates}
    assert value_of(stage, **fields) == pytest.approx(40.0, abs=1e-4)
    assert value_of(stage, **fields, freespace=True) == pytest.approx(36.0, abs=1e-4)


def test_distance_along_the_axes_of_a_turned_actor() -> None:
    stage = stage_of(one=at(0, 0, heading=math.pi / 2), other=at(30, 4))
    assert value_of(stage, kind="distance", to="other", along="longitudinal") == pytest.approx(4.0, abs=1e-4)
    along_lane = value_of(stage, kind="distance", to="other", along="longitudinal", coordinates="lane")
    assert along_lane == pytest.approx(30.0, abs=1e-4)  # the nearest lane leads east


def test_distance_to_a_place() -> None:
    assert value_of(stage_of(one=at(0)), kind="distance", to=PLACE) == pytest.approx(5.0, abs=1e-4)


def test_headway_and_time_to_collision() -> None:
    stage = stage_of(one=at(0, speed_mps=20, reach=CAR), other=at(34, speed_mps=14, reach=CAR))
    assert value_of(stage, kind="time_headway", to="other", freespace=True) == pytest.approx(1.5, abs=1e-4)
    assert value_of(stage, kind="time_to_collision", to="other") == pytest.approx(5.0, abs=1e-4)


def test_no_collision_is_far_ahead() -> None:
    stage = stage_of(one=at(0, speed_mps=10), other=at(34, speed_mps=14))
    less = condition(kind="time_to_collision", of=["one"], to="other", rule="less", value=1e6)
    assert not Watch(less).check(stage, NoBoard())[0]


@pytest.mark.parametrize(
    ("fields", "wanted"),
    [
        ({"kind": "speed"}, 5.0),
        ({"kind": "speed", "direction": "longitudinal"}, 4.0),
        ({"kind": "speed", "direction": "lateral"}, 3.0),
        ({"kind": "relative_speed", "to": "other"}, -5.0),
        ({"kind": "relative_speed", "to": "other", "direction": "longitudinal"}, -6.0),
        ({"kind": "acceleration"}, -2.5),
    ],
)
def test_speeds_and_accelerations(fields: dict[str, Any], wanted: float) -> None:
    one = Present(0.0, 0.0, 0.0, 4.0, 3.0, -2.5, POINT)
    assert value_of(stage_of(one=one, other=at(30, speed_mps=10)), **fields) == pytest.approx(wanted, abs=1e-4)


@pytest.mark.parametrize(
    ("fields", "holds"),
    [
        (
            {"kind": "reach", "position": PLACE, "tolerance_m": 5},
            True,
        ),
        (
            {"kind": "reach", "position": PLACE, "tolerance_m": 4},
            False,
        ),
        ({"kind": "angle", "angle_rad": 6.2, "tolerance_rad": 0.1}, True),
        ({"kind": "angle", "angle_rad": 6.0, "tolerance_rad": 0.1}, False),
        ({"kind": "angle", "angle_rad": 0.0, "tolerance_rad": 0.01, "relative": True}, True),
        ({"kind": "collision"}, True),
        ({"kind": "collision", "partner": "far"}, False),
        ({"kind": "offroad", "duration_s": 0}, False),
    ],
)
def test_conditions_without_a_value(fields: dict[str, Any], holds: bool) -> None:
    stage = stage_of(one=at(0, reach=CAR), other=at(3.9, 1.9, reach=CAR), far=at(4.1, reach=CAR))
    assert Watch(condition(of=["one"], **fields)).check(stage, NoBoard())[0] is holds


@pytest.mark.parametrize(("y_m", "off"), [(-1.7, False), (-1.8, True), (8.7, False), (8.8, True)])
def test_offroad_is_beside_all_lanes(y_m: float, off: bool) -> None:
    stage = stage_of(one=at(50, y_m))
    assert Watch(condition(kind="offroad", of=["one"], duration_s=0)).check(stage, NoBoard())[0] is off


@pytest.mark.parametrize(
    ("fields", "holds"),
    [
        ({"kind": "variable", "variable": "count", "rule": "equal", "value": 2}, True),
        ({"kind": "variable", "variable": "count", "rule": "less", "value": 2}, False),
        ({"kind": "variable", "variable": "mode", "rule": "equal", "word": "fast"}, True),
        ({"kind": "variable", "variable": "mode", "rule": "not_equal", "word": "fast"}, False),
        ({"kind": "parameter", "variable": "braking", "rule": "equal", "value": 1}, True),
        ({"kind": "parameter", "variable": "body", "rule": "equal", "word": "car"}, False),
    ],
)
def test_variables_and_parameters(fields: dict[str, Any], holds: bool) -> None:
    assert Watch(condition(**fields)).check(stage_of(), NoBoard())[0] is holds


@pytest.mark.parametrize(("which", "holds"), [("any", True), ("all", False)])
def test_any_or_all_actors(which: str, holds: bool) -> None:
    stage = stage_of(one=at(0, speed_mps=10), other=at(9, speed_mps=5))
    fast = condition(kind="speed", of=["one", "other"], which=which, rule="greater", value=7.0)
    assert Watch(fast).check(stage, NoBoard()) == (holds, {"one"})


def moments(series: list[bool], **fields: Any) -> list[int]:
    """Steps in which a condition holds, given the bare condition's truth."""
    stage, watch = stage_of(), Watch(condition(kind="variable", variable="count", rule="equal", value=1.0, **fields))
    held = []
    for step, holds in enumerate(series):
        stage.time_s, stage.numbers["count"] = round(step * STEP_S, 6), float(holds)
        if watch.check(stage, NoBoard())[0]:
            held.append(step)
    return held


PULSE = [False, False, True, True, True, False, False, False, False]


@pytest.mark.parametrize(
    ("fields", "wanted"),
    [
        ({}, [2, 3, 4]),
        ({"edge": "rising"}, [2]),
        ({"edge": "falling"}, [5]),
        ({"edge": "rising_or_falling"}, [2, 5]),
        ({"delay_s": 0.2}, [4, 5, 6]),
        ({"edge": "rising", "delay_s": 0.2}, [4]),
        ({"edge": "falling", "delay_s": 0.3}, [8]),
        ({"delay_s": 0.25}, [5, 6, 7]),  # between two steps: the step after
    ],
)
def test_edges_and_delays(fields: dict[str, Any], wanted: list[int]) -> None:
    assert moments(PULSE, **fields) == wanted


@pytest.mark.parametrize("edge", ["rising", "falling", "rising_or_falling"])
def test_an_edge_is_no_edge_where_it_is_evaluated_first(edge: str) -> None:
    assert moments([True, True], edge=edge) == []


def test_travelled_and_stood() -> None:
    stage = stage_of(one=at(0, speed_mps=10))
    travelled = Watch(condition(kind="travelled", of=["one"], value=2.0))
    stood = Watch(condition(kind="stand_still", of=["one"], duration_s=0.3))
    held = []
    for step in range(1, 10):
        moves = step <= 4
        stage.look({"one": at(min(step, 4) * 1.0, speed_mps=10.0 if moves else 0.0)})
        held.append((travelled.check(stage, NoBoard())[0], stood.check(stage, NoBoard())[0]))
    assert [moved for moved, _ in held] == [False] + [True] * 8
    assert [stands for _, stands in held].index(True) == 6  # in step 7, 0.3 s after the first that it stands in


@pytest.mark.parametrize(
    ("rule", "wanted"),
    [("greater", [2]), ("greater_or_equal", [1, 2]), ("less", [0]), ("less_or_equal", [0, 1]), ("equal", [1])],
)
def test_rules_compare_times(rule: str, wanted: list[int]) -> None:
    stage, watch = stage_of(), Watch(condition(kind="time", rule=rule, value=0.1))
    held = []
    for step in range(3):
        stage.time_s = round(step * STEP_S, 6)
        if watch.check(stage, NoBoard())[0]:
            held.append(step)
    assert held == wanted
