"""Positions, routes and trajectories on a junction, against coordinates by hand."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from pydantic import TypeAdapter

from risk_sac.config.story import Story
from risk_sac.config.story_actions import Position
from risk_sac.errors import ConfigError
from risk_sac.scenario.places import OnRoad, StoryPlaces, lanes_beside
from risk_sac.scenario.space import Value
from risk_sac.scenario.travel_line import Pose
from tests.unit.scenario.junction_roads import roads_and_net

EAST, NORTH, WEST, SOUTH = 0.0, math.pi / 2, math.pi, -math.pi / 2


def position(kind: str, **fields: Any) -> Position:
    """A position as a document writes it."""
    return TypeAdapter(Position).validate_python({"kind": kind, **fields})


def lane(road: str, lane: int, s_m: float, **more: Any) -> dict[str, Any]:
    """A position on a lane as a document writes it."""
    return {"kind": "lane", "road": road, "lane": lane, "s_m": s_m, **more}


STORY = Story.model_validate(
    {
        "routes": {
            "on": {"waypoints": [lane("A", -1, 50), lane("B", 1, 40)]},
            "left": {"waypoints": [lane("A", -2, 70), lane("C", -1, 60)]},
            "back": {"waypoints": [lane("C", 1, 30), lane("A", 1, 90)]},
            "nowhere": {"waypoints": [lane("B", 1, 40), lane("A", 1, 40)]},
        },
        "trajectories": {
            "across": {
                "kind": "polyline",
                "vertices": [
                    {"position": lane("A", -1, 40, offset_m=-4), "time_s": 1.0},
                    {"position": lane("A", -1, 40), "time_s": 3.0},
                    {"position": lane("A", -1, 40, offset_m=4, heading_rad=1.0), "time_s": 4.0},
                ],
            },
            "turn": {
                "kind": "clothoids",
                "segments": [
                    {"curvature_start": 0, "curvature_end": 0, "length_m": 10, "position": lane("A", -1, 80)},
                    {"curvature_start": 0.1, "curvature_end": 0.1, "length_m": 5 * math.pi},
                ],
            },
            "from_here": {
                "kind": "clothoids",
                "segments": [{"curvature_start": 0, "curvature_end": 0, "length_m": "2 * d", "time_s": 0}],
                "end_time_s": 4,
            },
            "itself": {
                "kind": "polyline",
                "vertices": [
                    {"position": {"kind": "on_trajectory", "trajectory": "itself", "s_m": 0}},
                    {"position": lane("A", -1, 40)},
                ],
            },
            "backwards": {
                "kind": "polyline",
                "vertices": [{"position": lane("A", -1, s), "time_s": 50 - s} for s in (10, 20, 30)],
            },
        },
    }
)


@pytest.fixture(scope="module")
def places() -> StoryPlaces:
    roads, net = roads_and_net()
    return StoryPlaces(net, roads, STORY, Value({"d": 20.0}, {}))


@pytest.fixture
def at(places: StoryPlaces) -> Callable[..., tuple[float, float, float]]:
    """Resolves positions, relative to an actor, in the road file's coordinates."""
    assert roads_and_net()[1].shift_m == (300.0, 200.0)
    shift_x, shift_y = roads_and_net()[1].shift_m

    def resolved(of: Position, actor: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[float, float, float]:
        there = Pose(actor[0] + shift_x, actor[1] + shift_y, actor[2])
        pose = places.pose(of, lambda name: {"actor": there}[name])
        return pose.x_m - shift_x, pose.y_m - shift_y, math.remainder(pose.heading_rad, math.tau)

    return resolved


def near(x_m: float, y_m: float, heading_rad: float) -> Any:
    """Approximately a pose; a half turn may have either sign."""
    heading_rad = math.remainder(heading_rad, math.tau)
    return pytest.approx((x_m, y_m, heading_rad), abs=1e-6)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        (lane("A", -1, "2 * d"), (40.0, -1.75, EAST)),
        (lane("A", 1, 40), (40.0, 1.75, WEST)),
        (lane("A", -2, 70, offset_m=0.5), (70.0, -4.75, EAST)),
        (lane("A", 1, 40, offset_m=0.5, heading_rad=0.1), (40.0, 2.25, WEST + 0.1)),
        (lane("A", 1, 40, heading_rad=0.1, heading="absolute"), (40.0, 1.75, 0.1)),
        (lane("B", 1, 30), (190.0, -1.75, EAST)),
        (lane("C", -1, 30), (121.75, 50.0, NORTH)),
        ({"kind": "road", "road": "B", "s_m": 30, "t_m": 2}, (190.0, -2.0, WEST)),
        ({"kind": "world", "x_m": 40, "y_m": 2}, (40.0, 2.0, WEST)),
        ({"kind": "world", "x_m": 40, "y_m": -30, "heading_rad": 0.3}, (40.0, -30.0, 0.3)),
        ({"kind": "on_route", "route": "on", "s_m": 20, "lane": -1}, (70.0, -1.75, EAST)),
        ({"kind": "on_route", "route": "on", "s_m": 90, "lane": -1, "offset_m": -1}, (140.0, -2.75, EAST)),
        ({"kind": "on_route", "route": "on", "s_m": 90, "lane": 1}, (140.0, 1.75, EAST)),
        ({"kind": "on_route", "route": "on", "s_m": 90, "t_m": 2, "heading_rad": 0.2}, (140.0, 2.0, 0.2)),
        ({"kind": "on_trajectory", "trajectory": "across", "s_m": 6, "t_m": 1}, (39.0, 0.25, NORTH)),
        ({"kind": "on_trajectory", "trajectory": "across", "s_m": 2, "heading_rad": -1}, (40.0, -3.75, NORTH - 1)),
    ],
)
def test_a_position_is_where_it_is_computed_by_hand(
    at: Callable[..., Any], fields: dict[str, Any], expected: tuple[float, float, float]
) -> None:
    assert at(position(**fields)) == near(*expected)


@pytest.mark.parametrize(
    ("actor", "fields", "expected"),
    [
        ((90.0, -1.75, EAST), {"kind": "relative_lane", "ds_m": 50}, (140.0, -1.75, EAST)),
        ((90.0, -1.75, EAST), {"kind": "relative_lane", "ds_m": -50, "offset_m": 1}, (40.0, -0.75, EAST)),
        ((90.0, -1.75, EAST), {"kind": "relative_lane", "lanes": 1, "ds_m": 50}, (140.0, 1.75, WEST)),
        ((90.0, -1.75, EAST), {"kind": "relative_lane", "lanes": -1}, (90.0, -5.25, EAST)),
        ((140.0, 1.75, WEST), {"kind": "relative_lane", "ds_m": 50}, (90.0, 1.75, WEST)),
        ((140.0, 1.75, WEST), {"kind": "relative_lane", "ds_m": 50, "along": "lane"}, (90.0, 1.75, WEST)),
        ((140.0, -1.75, EAST), {"kind": "relative_lane", "ds_m": 30, "along": "lane"}, (170.0, -1.75, EAST)),
        ((140.0, -1.75, EAST), {"kind": "relative_lane", "ds_m": -50, "along": "lane"}, (90.0, -1.75, EAST)),
        ((90.0, -1.0, EAST), {"kind": "relative_road", "ds_m": 50, "dt_m": -0.5}, (140.0, -1.5, EAST)),
        ((140.0, -1.0, EAST), {"kind": "relative_road", "ds_m": -10, "dt_m": 0.5}, (150.0, -1.5, WEST)),
        ((10.0, 5.0, NORTH), {"kind": "relative", "dx_m": 3, "dy_m": 1}, (9.0, 8.0, NORTH)),
        ((10.0, 5.0, NORTH), {"kind": "relative", "dx_m": 3, "dy_m": 1, "axes": "world"}, (13.0, 6.0, NORTH)),
    ],
)
def test_a_relative_position_goes_on_over_the_junction(
    at: Callable[..., Any],
    actor: tuple[float, float, float],
    fields: dict[str, Any],
    expected: tuple[float, float, float],
) -> None:
    assert at(position(**fields, to="actor"), actor) == near(*expected)


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        (lane("Z", -1, 0), "road"),
        (lane("A", -2, 10), "lane"),
        (lane("A", -1.5, 10), "lane"),
        (lane("A", -1, 101), "s_m"),
        (lane("A", -1, "1 / (d - 20)"), "s_m"),
        ({"kind": "on_route", "route": "on", "s_m": 200}, "s_m"),
        ({"kind": "on_route", "route": "off", "s_m": 0}, "route"),
        ({"kind": "on_route", "route": "nowhere", "s_m": 0}, "waypoints"),
        ({"kind": "on_trajectory", "trajectory": "across", "s_m": 9}, "s_m"),
        ({"kind": "on_trajectory", "trajectory": "itself", "s_m": 0}, "trajectory"),
        ({"kind": "on_trajectory", "trajectory": "backwards", "s_m": 0}, "vertices[1].time_s"),
        ({"kind": "on_trajectory", "trajectory": "from_here", "s_m": 0}, "segments[0].position"),
        ({"kind": "relative_lane", "to": "actor", "ds_m": 1000}, "ds_m"),
    ],
)
def test_a_place_that_is_not_there_is_refused_by_its_field(
    at: Callable[..., Any], fields: dict[str, Any], field: str
) -> None:
    with pytest.raises(ConfigError) as error:
        at(position(**fields), (90.0, -1.75, EAST))
    assert error.value.field == field


def test_lanes_of_the_net_keep_their_names_and_places(places: StoryPlaces) -> None:
    for id_, lanes, stations in (
        ("A", (1, -1), (10, 90)),
        ("A", (-2,), (80,)),
        ("B", (1, -1), (50,)),
        ("C", (1,), (5,)),
    ):
        for own in lanes:
            for s_m in stations:
                pose = places.lane_pose(OnRoad(id_, own, s_m, 0.0))
                spot = places.spot(pose)
                assert spot is not None
                assert f"{id_}_{own}" in spot.lane.original
                assert abs(spot.left_m) < 0.02
                assert places.opendrive(pose) == (id_, own, pytest.approx(s_m), pytest.approx(0.0, abs=1e-6))


def test_a_pose_in_a_junction_is_on_the_road_that_leads_its_way(places: StoryPlaces) -> None:
    for road, own in (("10", -1), ("10", 1), ("11", -1), ("11", 1)):
        assert places.opendrive(places.lane_pose(OnRoad(road, own, 12.0, 0.2))).road == road


def test_a_spot_is_on_the_lane_of_its_direction(places: StoryPlaces) -> None:
    right = places.spot(places.pose(position(**lane("A", -1, 70)), _nobody))
    left = places.spot(places.pose(position(**lane("A", 1, 70)), _nobody))
    assert right is not None
    assert left is not None
    assert right.lane.edge != left.lane.edge
    beside = places.beside(right, -1)
    assert beside is not None
    assert beside.lane.original == ("A_-2",)
    assert beside.at_m == pytest.approx(right.at_m, abs=0.01)
    assert places.beside(right, 1) is None
    assert places.spot(Pose(0.0, 5000.0, 0.0)) is None


def test_the_way_ahead_goes_straight_on_or_along_edges(places: StoryPlaces) -> None:
    shift_x, shift_y = roads_and_net()[1].shift_m
    spot = places.spot(places.pose(position(**lane("A", -1, 70)), _nobody))
    assert spot is not None
    on = places.ahead(spot, 100.0)
    assert on.length_m == pytest.approx(100.0)
    assert on.pose(100.0) == near(170.0 + shift_x, -1.75 + shift_y, EAST)
    line, edges = places.route("left", _nobody)
    left = places.ahead(spot, 100.0, edges)
    arc_m = 21.75 * math.pi / 2  # the lane is outside the arc of 20 m
    assert left.pose(30.0 + arc_m + 10.0) == pytest.approx((121.75 + shift_x, 30.0 + shift_y, NORTH), abs=1e-3)
    assert line.length_m > 30.0 + arc_m + 60.0  # it changes from lane -2 to lane -1
    assert places.ahead(spot, 1000.0).length_m == pytest.approx(150.0)


def test_a_route_is_the_line_along_lanes_and_the_edges_of_the_net(places: StoryPlaces) -> None:
    net = roads_and_net()[1]
    line, edges = places.route("back", _nobody)
    assert line.pose(0.0) == pytest.approx((118.25 + net.shift_m[0], 50.0 + net.shift_m[1], SOUTH + math.tau), abs=1e-6)
    assert line.pose(line.length_m)[:2] == pytest.approx((90.0 + net.shift_m[0], 1.75 + net.shift_m[1]))
    assert line.length_m == pytest.approx(30.0 + 18.25 * math.pi / 2 + 10.0, abs=1e-2)
    assert [net.edges[edge].lanes[-1].original[0] for edge in edges] == ["C_1", "A_1"]


def test_a_polyline_is_passed_at_its_times_and_faces_its_way(places: StoryPlaces) -> None:
    line = places.trajectory("across", _nobody)
    assert line.length_m == pytest.approx(8.0)
    assert (line.station_at(2.0), line.time_s(6.0)) == (pytest.approx(2.0), pytest.approx(3.5))
    assert line.pose(2.0).heading_rad == pytest.approx(NORTH)
    assert line.pose(8.0).heading_rad == pytest.approx(1.0)  # stated at the last vertex
    assert line.pose(6.0).heading_rad == pytest.approx((NORTH + 1.0) / 2)


def test_clothoids_go_on_from_each_other_or_from_an_actor(places: StoryPlaces) -> None:
    shift_x, shift_y = roads_and_net()[1].shift_m
    line = places.trajectory("turn", _nobody)
    assert line.pose(line.length_m) == pytest.approx((100.0 + shift_x, 8.25 + shift_y, NORTH), abs=1e-6)
    own = places.trajectory("from_here", _nobody, Pose(1.0, 2.0, NORTH))
    assert own.pose(40.0) == near(1.0, 42.0, NORTH)
    assert own.time_s(10.0) == pytest.approx(1.0)


def test_lane_0_is_not_counted() -> None:
    assert [lanes_beside(-1, lanes) for lanes in (-1, 0, 1, 2)] == [-2, -1, 1, 2]
    assert [lanes_beside(1, -lanes) for lanes in (-1, 0, 1, 2)] == [2, 1, -1, -2]


def test_without_a_road_file_places_are_found_by_the_lanes_of_the_net() -> None:
    net = roads_and_net()[1]
    places = StoryPlaces(net, None, Story(), Value({}, {}))
    shift_x, shift_y = net.shift_m
    here = Pose(70.0 + shift_x, -1.75 + shift_y, EAST)
    beside = position("relative_lane", to="actor", lanes=-1, ds_m=10.0)
    assert places.pose(beside, lambda _: here) == pytest.approx((80.0 + shift_x, -5.25 + shift_y, EAST), abs=0.02)
    with pytest.raises(ConfigError) as error:
        places.pose(position(**lane("A", -1, 10)), _nobody)
    assert error.value.field == "road"


def _nobody(name: str) -> Pose:
    raise AssertionError(name)
