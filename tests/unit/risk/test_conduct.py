import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.env.observation_layout import MOTION_PER_ADVERSARY, PER_ADVERSARY
from risk_sac.maps.carriageway import carriageway_of
from risk_sac.risk import conduct
from risk_sac.risk.conduct import (
    ACCELERATION,
    ADVERSARY_MEMORY,
    CONDUCT_ROWS,
    CUT_IN,
    ENTRY,
    JERK,
    LATERAL_SPEED,
    MEMORY_SCALE,
    OVER_LINE,
    PACING,
    PEDALS,
    SPEEDING,
    STANDING,
    TOWARDS_CAR,
    WALKING,
    ConductRoad,
    RoadFacts,
    conduct_terms,
    road_facts,
    soft_cost,
)
from risk_sac.risk.driving import FEATURES
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.world import types
from risk_sac.world.types import Kind, Role

LANE_M = 3.3
SQUARE = [(nx, ny, 10.0, 0.0) for nx, ny in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))]
STREET = RoadFacts(np.array([LANE_M]), np.array([13.9]), np.array(SQUARE[:0]).reshape(-1, 4))
JUNCTION = RoadFacts(np.array([LANE_M]), np.array([13.9]), np.array(SQUARE))  # within 10 m of the middle
EGO = {"speed": 12.0}
MERGE = Layout(
    net="motorway_ramp/motorway_ramp.net.xml",
    ego=VehicleStart(id="ego", role=Role.EGO, route=("main",), lane=0, position_m=100.0, speed_mps=25.0),
    vehicles=(),
)


def state_of(*bodies: dict[str, float]) -> np.ndarray:
    """Columns of a frame; bodies default to cars driving along x."""
    state = np.zeros((11, len(bodies)))
    for i, body in enumerate(bodies):
        usual = {"length": 4.6, "width": 1.8} | body
        for name, value in usual.items():
            state[getattr(types, name.upper()), i] = value
    return state


class Played:
    """Adversary in column 1 beside an ego, with the cost's memory."""

    def __init__(self, kind: Kind = Kind.VEHICLE, road: RoadFacts = STREET) -> None:
        self.memory, self.road = np.zeros((CONDUCT_ROWS, 1)), road
        self.kind = np.array([Kind.VEHICLE, kind], dtype=np.int8)

    def step(
        self, other: dict[str, float], ego: dict[str, float] = EGO, times: int = 1, link: str = "\0"
    ) -> np.ndarray:
        state = state_of(ego, other)
        links = np.array([0, ord(link)], dtype=np.uint8)
        for _ in range(times):
            terms = conduct_terms(np.array([1]), np.array([0]), self.kind, links, state, self.memory, self.road)
        return terms[0]


FAR = {"x": 100.0, "speed": 12.0}


@pytest.mark.parametrize(("name", "free"), [("braking", conduct.BRAKING_FREE), ("walking_speed", conduct.WALKING_FREE)])
def test_a_published_scale_begins_where_1_of_100_goes_and_ends_where_1_of_10_000_goes(name, free):
    assert FEATURES[name].spread.above(free) == pytest.approx(1e-2, rel=1e-3)


def test_braking_costs_by_its_own_scale_whatever_the_limits():
    half_way = (conduct.BRAKING_FREE + conduct.BRAKING_FULL) / 2
    assert Played().step(FAR | {"accel": -4.0})[ACCELERATION] == 0.0
    assert Played().step(FAR | {"accel": -half_way})[ACCELERATION] == pytest.approx(0.5)
    assert Played().step(FAR | {"accel": -9.0})[ACCELERATION] == 1.0


def pedals(swings: int) -> float:
    """Term after `swings` changes between 2 and -4 m/s², a second each."""
    played = Played()
    for swing in range(swings + 1):
        terms = played.step(FAR | {"accel": 2.0 if swing % 2 else -4.0}, times=10)
    return float(terms[PEDALS])


def test_changing_between_gas_and_brake_costs_from_the_second_time_on():
    assert pedals(0) == pedals(1) == 0.0
    assert 0.0 < pedals(3) < pedals(5) == 1.0


def test_a_pedal_that_is_touched_for_a_step_is_none():
    played = Played()
    for _ in range(20):
        assert played.step(FAR | {"accel": 2.6}, times=5)[PEDALS] == 0.0
        assert played.step(FAR | {"accel": -4.5})[PEDALS] == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_working_to_stay_level_costs_after_a_while_and_cruising_side_by_side_does_not(side):
    beside = {"y": side * LANE_M, "speed": 12.0}
    assert Played().step(beside, times=100)[PACING] == 0.0
    assert Played().step(beside | {"accel": 1.0}, times=14)[PACING] == 0.0
    assert Played().step(beside | {"accel": 1.0}, times=40)[PACING] == pytest.approx(1.0)
    assert Played().step(beside | {"accel": 1.0, "speed": 14.0}, times=40)[PACING] == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_keeping_to_the_line_costs_and_crossing_it_does_not(side):
    over = FAR | {"offset": side * 0.9}
    assert Played().step(over, times=20)[OVER_LINE] == pytest.approx(1.0)
    assert Played().step(over | {"lateral": -side * 0.8}, times=20)[OVER_LINE] == 0.0
    assert Played().step(FAR | {"offset": side * 0.4}, times=50)[OVER_LINE] == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_cutting_in_costs_by_the_room_that_it_leaves(side):
    def cut_in(ahead_m: float) -> float:
        other = {"x": 4.6 + ahead_m, "y": side * 2.4, "offset": -side * 0.9, "lateral": -side * 0.8, "speed": 12.0}
        return float(Played().step(other)[CUT_IN])

    assert cut_in(-2.0) == conduct.OVERLOOKS  # beside the ego
    assert cut_in(12.0 * conduct.HEADWAY_FREE + 0.01) == 0.0
    assert 0.0 < cut_in(2.0) < conduct.OVERLOOKS
    away = {"x": 2.0, "y": side * 2.4, "offset": -side * 0.9, "lateral": side * 0.8, "speed": 12.0}
    assert Played().step(away)[CUT_IN] == 0.0


def test_moving_across_costs_beyond_a_quick_lane_change():
    assert Played().step(FAR | {"lateral": 1.0})[LATERAL_SPEED] == 0.0
    assert Played().step(FAR | {"lateral": -1.4})[LATERAL_SPEED] == pytest.approx(0.5)


def test_standing_costs_where_nothing_is_ahead_and_the_light_is_not_red():
    still = {"x": 60.0, "y": 20.0, "heading": math.pi / 2}
    assert Played().step(still, times=60)[STANDING] == 1.0
    assert Played().step(still, times=60, link="r")[STANDING] == 0.0
    assert Played().step(still, times=60, ego={"x": 60.0, "y": 28.0})[STANDING] == 0.0


def test_jerking_costs_and_pressing_a_pedal_as_ordinary_drivers_do_does_not():
    def jerks(*accels: float) -> list[float]:
        played = Played()
        return [float(played.step(FAR | {"accel": accel})[JERK]) for accel in accels]

    assert max(jerks(-1.0, -2.0, -3.0, -4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0)) == 0.0  # 10 m/s³
    assert jerks(-7.5) == [pytest.approx(0.5)]  # 15 m/s³
    assert jerks(*[-8.0] * 9, 3.0)[-1] > 0.9


def test_speeding_costs_where_1_of_100_drive_so_fast():
    limit = float(STREET.limit_mps[0])
    assert Played().step(FAR | {"speed": limit + 6.0})[SPEEDING] == 0.0
    assert Played().step(FAR | {"speed": limit + 12.0})[SPEEDING] == 1.0


def test_the_limit_and_the_line_are_those_of_the_lane_where_an_adversary_is():
    road = ConductRoad(MERGE, 30.0, carriageway_of(MERGE.net))
    ramp, main, outside = {"x": 400.0, "y": -32.9, "heading": 0.124}, {"x": 400.0, "y": -1.75}, {"x": -500.0}
    rows, state = np.array([1, 2, 3]), state_of(EGO, ramp, main, outside)
    facts = road_facts(rows, state, *road.near(rows, state))
    assert facts.limit_mps.tolist() == pytest.approx([22.22, 36.0, 30.0])
    assert facts.lane_width_m.tolist() == pytest.approx([3.5, 3.5, MERGE.lane_width_m])


def test_terms_add_up_and_count_less_far_from_the_ego():
    terms = np.zeros((2, conduct.TERMS))
    terms[0, [PEDALS, ENTRY]], terms[1, OVER_LINE] = (0.2, 0.3), 0.5
    state = state_of(EGO, {"x": 20.0}, {"y": -40.0})
    cost = soft_cost(terms, np.array([1, 2]), state)
    assert cost == pytest.approx(0.5 * math.exp(-1.0) + 0.5 * math.exp(-2.0))
    assert soft_cost(terms * 9.0, np.array([1, 2]), state_of(EGO, {}, {})) == 1.0
    assert soft_cost(terms[:0], np.array([], dtype=np.intp), state) == 0.0


def turned(body: dict[str, float], angle: float) -> dict[str, float]:
    """Turns a body on the x axis about the junction's middle."""
    return body | {"x": body["x"] * math.cos(angle), "y": body["x"] * math.sin(angle), "heading": angle}


def entries(letter: str, wait_s: float, ego: dict[str, float], angle: float = 0.0, ego_link: str = "G") -> list[float]:
    """Terms of each step from an entry through the junction and out."""
    played = Played(road=JUNCTION)
    waits = turned({"x": -13.0, "speed": 0.0}, angle)
    links = {"waits": [ord(ego_link), ord(letter)], "goes": [ord(ego_link), 0]}
    terms = []
    ways = ["waits"] * round(wait_s * 10) + ["goes"] * 50
    for step, way in enumerate(ways):
        gone_m = 0.8 * max(0, step - round(wait_s * 10))
        other = waits if way == "waits" else turned({"x": -12.0 + gone_m, "speed": 8.0}, angle)
        link = np.array(links[way], dtype=np.uint8)
        row, slot = np.array([1]), np.array([0])
        step_terms = conduct_terms(
            row, slot, played.kind, link, state_of(turned(ego, 0.0), other), played.memory, JUNCTION
        )
        if way == "goes":
            terms.append(float(step_terms[0, ENTRY]))
    return terms


ELSEWHERE = {"x": 300.0, "speed": 10.0}


@pytest.mark.parametrize("angle", [math.pi / 2, -math.pi / 2])
def test_entering_on_red_costs_until_the_junction_is_left_and_more_the_longer_it_was_red(angle):
    late = entries("r", 5.0, ELSEWHERE, angle)
    assert late[0] == late[20] == conduct.OVERLOOKS
    assert late[-1] == 0.0
    assert 0.15 < entries("r", 2.0, ELSEWHERE, angle)[0] < 0.35
    assert entries("G", 5.0, ELSEWHERE, angle)[0] == entries("y", 5.0, ELSEWHERE, angle)[0] == 0.0


@pytest.mark.parametrize("angle", [math.pi / 2, -math.pi / 2])
def test_entering_before_one_that_has_priority_costs_a_part(angle):
    near, far = {"x": -15.0, "speed": 12.0}, {"x": -80.0, "speed": 12.0}
    close = entries("g", 1.0, near, angle)
    assert 0.02 < close[0] < 0.2
    assert close[-1] == 0.0
    assert entries("g", 1.0, far, angle)[0] == 0.0
    assert entries("g", 1.0, near, angle, ego_link="r")[0] == 0.0
    assert entries("g", 1.0, turned(near, 0.0) | {"x": 30.0}, angle)[0] == 0.0  # it is past


def test_crawling_in_a_junction_costs_and_crawling_on_the_road_does_not():
    slow = {"x": 0.0, "speed": 2.0}
    ahead = {"x": 100.0, "speed": 12.0}
    assert Played(road=JUNCTION).step(slow, ahead, times=60)[STANDING] == 1.0
    assert Played(road=JUNCTION).step(slow | {"x": 30.0}, ahead, times=60)[STANDING] == 0.0
    assert Played(road=JUNCTION).step(slow | {"speed": 5.0}, ahead, times=60)[STANDING] == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_walking_at_a_car_costs_and_crossing_before_it_does_not(side):
    def walk(heading: float, x: float = 15.0, y: float = 0.0) -> float:
        walker = {"length": 0.3, "width": 0.5, "x": x, "y": side * y, "speed": 1.3, "heading": side * heading}
        walker |= {"vx": 1.3 * math.cos(heading), "vy": 1.3 * side * math.sin(heading)}
        return float(Played(Kind.PEDESTRIAN).step(walker)[TOWARDS_CAR])

    assert walk(math.pi) == 1.0
    assert walk(-math.pi / 2) == 0.0
    assert walk(-math.pi / 2, x=0.0, y=1.4) == pytest.approx(0.5)  # into the side of the car, from 0.5 m
    assert walk(math.pi, y=6.0) == 0.0  # on the sidewalk


def test_a_pedestrian_costs_that_walks_faster_than_most_or_stands_in_the_cars_way():
    walker = {"length": 0.3, "width": 0.5, "x": 15.0}
    fast = Played(Kind.PEDESTRIAN).step(walker | {"speed": 3.0, "heading": math.pi / 2})
    assert fast[WALKING] == 1.0
    assert Played(Kind.PEDESTRIAN).step(walker, times=60)[STANDING] == 1.0
    assert Played(Kind.PEDESTRIAN).step(walker, ego={"speed": 0.0}, times=60)[STANDING] == 0.0


def test_a_cyclist_may_be_faster_than_a_pedestrian():
    quick = {"x": 60.0, "y": 4.0, "heading": -math.pi / 2, "speed": 6.0, "vy": -6.0}
    assert Played(Kind.PEDESTRIAN).step(quick | {"length": 0.5})[WALKING] == 1.0
    assert Played(Kind.PEDESTRIAN).step(quick | {"length": 1.6})[WALKING] == 0.0


def test_the_cost_is_that_of_the_worst_adversary_and_0_without_one():
    state = state_of(EGO, FAR | {"accel": -9.0}, FAR | {"x": 150.0})
    memory, link = np.zeros((CONDUCT_ROWS, 2)), np.zeros(3, dtype=np.uint8)
    kind = np.zeros(3, dtype=np.int8)
    rows, none = np.array([1, 2]), np.array([], dtype=np.intp)
    assert conduct_terms(rows, np.array([0, 1]), kind, link, state, memory, STREET).max() == 1.0
    assert conduct_terms(none, none, kind, link, state, memory, STREET).max(initial=0.0) == 0.0


values = st.floats(-50, 50)


@given(st.lists(st.tuples(values, values, values, values, values, st.floats(0, 30)), min_size=1, max_size=30))
def test_every_term_stays_in_the_unit_interval(steps):
    names = ("x", "y", "heading", "accel", "lateral", "speed")
    for kind in Kind:
        played = Played(kind)
        for step in steps:
            terms = played.step(dict(zip(names, step, strict=True)))
            assert 0.0 <= terms.min() <= terms.max() <= 1.0


def test_the_observation_holds_all_that_the_cost_remembers():
    assert PER_ADVERSARY - MOTION_PER_ADVERSARY == ADVERSARY_MEMORY == len(MEMORY_SCALE)
