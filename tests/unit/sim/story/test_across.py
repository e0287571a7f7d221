"""Actions across, and trajectories, against numbers computed by hand."""

import math
from typing import Any

import pytest

from risk_sac.scenario.layout import StoryActor
from risk_sac.scenario.travel_line import Pose
from risk_sac.sim.story.cast import Drift
from tests.unit.sim.story.straight import CAR, POINT, Drive, after, car, one_event, story_of


def lane_change(lanes: int, **dynamics: Any) -> dict[str, Any]:
    return {"kind": "lane_change", "target": {"to": "ego", "lanes": lanes}, "dynamics": dynamics}


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("dynamics", "shares"),
    [
        ({"shape": "linear", "by": "time", "value": 5.0}, {2.0: 0.2, 3.5: 0.5, 6.0: 1.0}),
        ({"shape": "linear", "by": "rate", "value": 0.7}, {2.0: 0.2, 6.0: 1.0}),
        ({"shape": "linear", "by": "distance", "value": 50.0}, {2.0: 0.2, 6.0: 1.0}),
        ({"shape": "cubic", "by": "time", "value": 5.0}, {2.0: 3 * 0.04 - 2 * 0.008, 6.0: 1.0}),
        ({"shape": "sinusoidal", "by": "time", "value": 5.0}, {2.0: (1 - math.cos(0.2 * math.pi)) / 2, 6.0: 1.0}),
        ({"shape": "sinusoidal", "by": "rate", "value": 3.5 * math.pi / 10}, {3.5: 0.5, 6.0: 1.0}),
        ({"shape": "step"}, {1.0: 1.0, 2.0: 1.0}),
    ],
)
def test_lane_change_has_its_shape(side: int, dynamics: dict[str, Any], shares: dict[float, float]) -> None:
    story = story_of([one_event("lead", lane_change(0, **dynamics), start=after(1.0))])
    drive = Drive(story, {"lead": car(50.0, 1 + side, reach=POINT)}, ego=Pose(0.0, 3.5, 0.0))
    for time_s, share in shares.items():
        at = drive.to(time_s)["lead"]
        assert at.y_m == pytest.approx(3.5 + side * 3.5 * (1 - share), abs=1e-6)
        assert at.x_m == pytest.approx(50.0 + 10.0 * time_s, abs=1e-6)


@pytest.mark.parametrize("side", [1, -1])
def test_body_points_to_where_its_rear_axle_moves(side: int) -> None:
    story = story_of([one_event("lead", lane_change(0, shape="linear", by="rate", value=1.0))])
    drive = Drive(story, {"lead": car(50.0, 1 + side)}, ego=Pose(0.0, 3.5, 0.0))
    at = drive.to(1.0)["lead"]
    turned = -side * math.atan(0.1)
    assert at.heading_rad == pytest.approx(turned)
    middle = 60.0 + CAR.ahead_m * math.cos(turned), 3.5 + side * 2.5 + CAR.ahead_m * math.sin(turned)
    assert (at.x_m, at.y_m) == pytest.approx(middle)


@pytest.mark.parametrize("side", [1, -1])
def test_lane_change_to_lanes_beside_another_actor_with_an_offset(side: int) -> None:
    do = lane_change(side, shape="linear", by="time", value=2.0) | {"offset_m": 0.5}
    drive = Drive(story_of([one_event("lead", do)]), {"lead": car(50.0, 1)}, ego=Pose(0.0, 3.5, 0.0))
    assert drive.to(3.0)["lead"].y_m == pytest.approx(3.5 + side * 3.5 + 0.5)


def test_missing_lane_leaves_the_actor_where_it_is() -> None:
    drive = Drive(story_of([one_event("lead", lane_change(-1, shape="step"))]), {"lead": car(50.0, 0)})
    assert drive.to(1.0)["lead"].y_m == 0.0
    assert drive.engine.unmet


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("shape", "lasts_s"),
    [
        ("sinusoidal", math.pi * math.sqrt(1.0 / (2 * 0.5))),  # a = π² d / 2 T²
        ("cubic", math.sqrt(6 * 1.0 / 0.5)),  # a = 6 d / T²
        ("linear", 2 * math.sqrt(1.0 / 0.5)),
    ],
)
def test_lane_offset_keeps_its_lateral_acceleration(side: int, shape: str, lasts_s: float) -> None:
    do = {"kind": "lane_offset", "target": side * 1.0, "shape": shape, "lateral_mps2": 0.5}
    drive = Drive(story_of([one_event("lead", do)]), {"lead": car(50.0, 1, reach=POINT)})
    drive.to(6.0)
    halfway = drive.history[round(lasts_s / 2 / 0.1)]["lead"]
    assert halfway.y_m == pytest.approx(3.5 + side * 0.5, abs=0.05)
    reached = next(k for k, moment in enumerate(drive.history) if abs(moment["lead"].y_m - 3.5) >= 1.0 - 1e-9)
    assert reached * 0.1 == pytest.approx(lasts_s, abs=0.1)


def test_lane_offset_relative_to_the_ego() -> None:
    do = {"kind": "lane_offset", "target": {"to": "ego", "value": 0.25}, "shape": "step"}
    drive = Drive(story_of([one_event("lead", do)]), {"lead": car(50.0, 1)}, ego=Pose(0.0, 0.5, 0.0))
    assert drive.to(0.1)["lead"].y_m == pytest.approx(0.5 + 0.25)


def test_continuous_lane_offset_ends_with_the_next_action_across() -> None:
    acts = [
        one_event("lead", {"kind": "lane_offset", "target": 0.5, "shape": "step", "continuous": True}),
        one_event("lead", lane_change(1, shape="step"), start=after(2.0)),
    ]
    drive = Drive(story_of(acts), {"lead": car(50.0, 0)})
    assert drive.to(1.9)["lead"].y_m == pytest.approx(0.5)
    assert drive.to(3.0)["lead"].y_m == pytest.approx(3.5)


@pytest.mark.parametrize("side", [1, -1])
def test_lateral_distance_is_kept_to_the_others_side(side: int) -> None:
    do = {"kind": "lateral_distance", "to": "ego", "distance_m": 0.5, "freespace": True, "speed_mps": 1.0}
    drive = Drive(story_of([one_event("lead", do)]), {"lead": car(0.0, 1 + side)}, ego=Pose(0.0, 3.5, 0.0))
    assert drive.to(0.5)["lead"].left_m == pytest.approx(-side * 0.5)
    drive.to(3.0)
    assert drive.engine.played["lead"].y_m == pytest.approx(3.5 + side * (0.5 + 2.0), abs=0.01)


def walk(timing: dict[str, Any] | None, **fields: Any) -> dict[str, Any]:
    return {"kind": "follow_trajectory", "trajectory": "across", "timing": timing, **fields}


def trajectory(*times: float | None, side: int = 1) -> dict[str, Any]:
    points = [(100.0, -4.0 * side), (100.0, 4.0 * side), (104.0, 4.0 * side)]
    vertices = [
        {"position": {"kind": "world", "x_m": x, "y_m": y, "heading_rad": side * math.pi / 2}, "time_s": time_s}
        for (x, y), time_s in zip(points, times, strict=False)
    ]
    return {"across": {"kind": "polyline", "vertices": vertices}}


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("timing", "begins_s"),
    [({"domain": "relative"}, 2.0), ({"domain": "absolute", "offset_s": 3.0}, 3.0), ({"domain": "absolute"}, 0.0)],
)
def test_timed_trajectory_is_passed_at_its_times(side: int, timing: dict[str, Any], begins_s: float) -> None:
    story = story_of(
        [one_event("walker", walk(timing), start=after(2.0))], trajectories=trajectory(0.0, 8.0, side=side)
    )
    walker = StoryActor(Pose(100.0, -4.0 * side, side * math.pi / 2), 0.0, POINT, free=True)
    drive = Drive(story, {"walker": walker})
    for time_s in (2.5, 4.0, 6.5):
        at = drive.to(time_s)["walker"]
        wanted = -4.0 * side + side * min(max(time_s - begins_s, 0.0), 8.0)
        assert (at.x_m, at.y_m) == pytest.approx((100.0, wanted), abs=1e-6)
        assert at.speed_mps == pytest.approx(1.0 if time_s > begins_s else 0.0, abs=1e-6)
        assert at.heading_rad == pytest.approx(side * math.pi / 2)


def test_scaled_trajectory_takes_longer() -> None:
    story = story_of([one_event("walker", walk({"domain": "relative", "scale": 2.0}))], trajectories=trajectory(0, 8))
    drive = Drive(story, {"walker": StoryActor(Pose(100.0, -4.0, 0.0), 0.0, POINT, free=True)})
    assert drive.to(8.0)["walker"].y_m == pytest.approx(0.0)


def test_untimed_trajectory_is_followed_at_the_own_speed() -> None:
    story = story_of([one_event("car", walk(None, from_m=2.0))], trajectories=trajectory(None, None, None))
    drive = Drive(story, {"car": car(0.0, speed_mps=2.0, reach=POINT)})
    assert (drive.to(1.0)["car"].x_m, drive.to(1.0)["car"].y_m) == pytest.approx((100.0, 0.0))
    assert (drive.to(4.0)["car"].x_m, drive.to(4.0)["car"].y_m) == pytest.approx((102.0, 4.0))
    assert drive.to(5.1)["car"] is not None
    assert drive.engine.states["story::act"] == "complete"


def test_teleport_puts_the_actor_on_its_new_lane() -> None:
    there = {"kind": "teleport", "position": {"kind": "world", "x_m": 500.0, "y_m": 7.0, "heading_rad": 0.0}}
    drive = Drive(story_of([one_event("car", there, start=after(1.0))]), {"car": car(0.0, reach=POINT)})
    at = drive.to(2.0)["car"]
    assert (at.x_m, at.y_m, at.speed_mps) == pytest.approx((510.0, 7.0, 10.0))


def test_deleted_actor_is_gone() -> None:
    drive = Drive(story_of([one_event("car", {"kind": "delete"}, start=after(1.0))]), {"car": car(0.0)})
    assert "car" in drive.to(0.9)
    assert "car" not in drive.to(1.0)


def test_hidden_actor_is_not_sensed() -> None:
    hide = {"kind": "visibility", "traffic": True, "sensors": False}
    drive = Drive(story_of([one_event("car", hide, start=after(1.0))]), {"car": car(0.0)})
    assert drive.to(0.9)["car"].sensed
    assert not drive.to(1.0)["car"].sensed


def test_free_actor_acquires_a_position_straight_on() -> None:
    goal = {"kind": "acquire_position", "position": {"kind": "world", "x_m": 3.0, "y_m": 4.0, "heading_rad": 0.0}}
    drive = Drive(
        story_of([one_event("walker", goal)]), {"walker": StoryActor(Pose(0.0, 0.0, 0.0), 1.0, POINT, free=True)}
    )
    at = drive.to(5.0)["walker"]
    assert (at.x_m, at.y_m) == pytest.approx((3.0, 4.0))


def test_vehicle_acquires_a_position_along_its_lane() -> None:
    goal = {"kind": "acquire_position", "position": {"kind": "world", "x_m": 300.0, "y_m": 3.5, "heading_rad": 0.0}}
    drive = Drive(story_of([one_event("car", goal)]), {"car": car(0.0, 1, reach=POINT)})
    at = drive.to(5.0)["car"]
    assert (at.x_m, at.y_m, at.speed_mps) == pytest.approx((50.0, 3.5, 10.0))


def test_deviation_ahead_does_not_end_a_timed_trajectory() -> None:
    events = [one_event("walker", walk({"domain": "relative"}))]
    story = story_of(events, trajectories=trajectory(0.0, 8.0))
    drive = Drive(story, {"walker": StoryActor(Pose(100.0, -4.0, math.pi / 2), 0.0, POINT, free=True)})
    at = drive.to(8.0, {"walker": lambda mover, room: Drift(0.0, 0.0, 3.0, 0.0)})["walker"]
    assert at.y_m == pytest.approx(7.0)
