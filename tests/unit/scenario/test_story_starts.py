"""Starts by a document's road file, and the ego's way by story."""

import math
from collections.abc import Mapping
from typing import Any

import pytest

from risk_sac.config import Scenario
from risk_sac.errors import ConfigError
from risk_sac.scenario.bodies import BODIES
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.lane_places import lane_line
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.scenario.scene import SceneLayout
from risk_sac.world.types import Role
from tests.unit.scenario.junction_roads import net_file, roads_and_net

HALF_CAR_M = BODIES["car"].length_m / 2
BOX = {"length_m": 4.0, "width_m": 1.8, "ahead_m": 1.5}


def on_lane(road: str, lane: int, s_m: float, **more: Any) -> dict[str, Any]:
    return {"position": {"kind": "lane", "road": road, "lane": lane, "s_m": s_m, **more}}


def layout_of(actors: Mapping[str, Any] = {}, *, ego: Any = None, speed: float = 10.0, **story: Any) -> Layout:
    """Layout of a document on the junction; the ego starts on A."""
    document = Scenario.model_validate(
        {
            "name": "starts",
            "network": "junction.net.xml",
            "road": "junction.xodr",
            "ego": {"start": ego or on_lane("A", -1, 20, offset_m=0.4), "speed": speed, "box": BOX},
            "actors": {name: {"role": "story", **actor} for name, actor in actors.items()},
            "story": story,
        }
    )
    interpreter = Interpreter(document, {"junction.net.xml": str(net_file())})
    value = interpreter.value({})
    return SceneLayout(document, value, *interpreter.net(value), interpreter.horizon_s).layout()


def front_of(start: VehicleStart) -> tuple[float, float]:
    """Front bumper of a vehicle, in the road file's coordinates."""
    net = roads_and_net()[1]
    lane = net.lanes[f"{start.route[0]}_{start.lane}"]
    x_m, y_m, _ = lane_line(lane).pose(start.position_m, start.left_m)
    return x_m - net.shift_m[0], y_m - net.shift_m[1]


def names(layout: Layout) -> list[str]:
    """Roads and lanes of OpenDRIVE on the ego's way."""
    edges = roads_and_net()[1].edges
    return [edges[edge].lanes[-1].original[0] for edge in layout.ego.route]


def test_a_vehicle_starts_with_its_front_where_its_reference_point_puts_it() -> None:
    layout = layout_of({"other": {"start": on_lane("A", 1, 50, offset_m=-0.3), "speed": 3.0}})
    (other,) = layout.vehicles
    assert front_of(layout.ego) == pytest.approx((20.0 + 1.5 + BOX["length_m"] / 2, -1.35), abs=0.02)
    assert front_of(other) == pytest.approx((50.0 - HALF_CAR_M, 1.45), abs=0.02)
    assert other.left_m == pytest.approx(0.3, abs=0.02)  # it drives the other way
    assert other.role is Role.STORY


def test_bodies_beside_lanes_start_in_their_middles() -> None:
    walker = {"body": "pedestrian", "start": on_lane("A", -1, 40, offset_m=-4, heading_rad=math.pi / 2), "speed": 1.0}
    parked = {"role": "static", "start": on_lane("A", -1, 60, heading_rad=0.5), "box": BOX}
    layout = layout_of({"walker": walker, "parked": parked})
    shift_x, shift_y = roads_and_net()[1].shift_m
    (pedestrian,), (static,) = layout.pedestrians, layout.statics
    assert (pedestrian.x_m, pedestrian.y_m) == pytest.approx((40.0 + shift_x, -5.75 + shift_y))
    assert pedestrian.heading_rad == pytest.approx(math.pi / 2)
    middle = (60.0 + 1.5 * math.cos(0.5) + shift_x, -1.75 + 1.5 * math.sin(0.5) + shift_y)
    assert (static.x_m, static.y_m) == pytest.approx(middle)


@pytest.mark.parametrize("speed", [10.0, 30.0])
def test_a_start_is_as_fast_as_the_document_says(speed: float) -> None:
    assert layout_of(speed=speed).ego.speed_mps == speed


def test_the_ego_goes_straight_on_unless_its_story_says_another_way() -> None:
    assert names(layout_of())[-1] == "B_1"


@pytest.mark.parametrize(
    "do",
    [
        {"kind": "assign_route", "route": "left"},
        {"kind": "follow_trajectory", "trajectory": "left"},
        {"kind": "acquire_position", "position": on_lane("C", -1, 50)["position"]},
    ],
)
@pytest.mark.parametrize("at_start", [True, False])
def test_the_ego_takes_its_way_from_its_story(do: Mapping[str, Any], *, at_start: bool) -> None:
    ways = {
        "routes": {"left": {"waypoints": [on_lane("A", -1, 20)["position"], on_lane("C", -1, 50)["position"]]}},
        "trajectories": {
            "left": {
                "kind": "clothoids",
                "segments": [
                    {
                        "curvature_start": 0,
                        "curvature_end": 0,
                        "length_m": 80,
                        "position": on_lane("A", -1, 20)["position"],
                    },
                    {"curvature_start": 0.046, "curvature_end": 0.046, "length_m": math.pi / 2 / 0.046},
                    {"curvature_start": 0, "curvature_end": 0, "length_m": 40},
                ],
            }
        },
    }
    event = {"name": "event", "actions": [{"do": do}]}
    act = {"groups": [{"actors": ["ego"], "maneuvers": [{"events": [event]}]}]}
    told = {"init": [{"actor": "ego", "do": do}]} if at_start else {"stories": {"story": [act]}}
    assert names(layout_of(**ways, **told))[-1] == "C_-1"


def test_a_story_vehicle_may_start_inside_a_junction_and_the_ego_may_not() -> None:
    (other,) = layout_of({"other": {"start": on_lane("11", -1, 15)}}).vehicles
    net = roads_and_net()[1]
    assert net.edges[other.route[0]].lanes[-1].original == ("A_-1",)
    with pytest.raises(ConfigError) as error:
        layout_of(ego=on_lane("11", -1, 15))
    assert error.value.field == "ego.start.position"


def test_a_place_that_is_not_there_is_refused_by_its_path() -> None:
    with pytest.raises(ConfigError) as error:
        layout_of({"other": {"start": on_lane("A", -7, 15)}})
    assert error.value.field == "actors.other.start.position.lane"
