"""Actions along: speeds and distances, against numbers computed by hand."""

import math
from typing import Any

import pytest

from risk_sac.scenario.travel_line import Pose
from tests.unit.sim.story.straight import CAR, POINT, Drive, after, car, one_event, story_of


def speed(target: Any, **dynamics: Any) -> dict[str, Any]:
    return {"kind": "speed", "target": target, "dynamics": dynamics}


@pytest.mark.parametrize(
    ("dynamics", "speeds"),
    [
        ({"shape": "step"}, {1.1: 14.0, 2.0: 14.0}),
        ({"shape": "linear", "by": "rate", "value": 2.0}, {1.5: 11.0, 2.0: 12.0, 3.0: 14.0, 4.0: 14.0}),
        ({"shape": "linear", "by": "rate", "value": -2.0}, {2.0: 12.0}),  # the size of a rate counts
        ({"shape": "linear", "by": "time", "value": 4.0}, {3.0: 12.0, 5.0: 14.0}),
        ({"shape": "cubic", "by": "time", "value": 4.0}, {2.0: 10 + 4 * (3 / 16 - 2 / 64), 3.0: 12.0}),
        ({"shape": "cubic", "by": "rate", "value": 3.0}, {2.0: 12.0, 3.0: 14.0}),  # lasts 1.5 · 4 / 3 s
        ({"shape": "sinusoidal", "by": "time", "value": 4.0}, {2.0: 10 + 2 * (1 - math.sqrt(0.5)), 5.0: 14.0}),
        ({"shape": "sinusoidal", "by": "rate", "value": math.pi}, {2.0: 12.0, 3.0: 14.0}),  # lasts π/2 · 4 / π s
    ],
)
def test_speed_has_its_shape(dynamics: dict[str, Any], speeds: dict[float, float]) -> None:
    drive = Drive(story_of([one_event("lead", speed(14.0, **dynamics), start=after(1.0))]), {"lead": car(50.0)})
    assert drive.to(1.0)["lead"].speed_mps == pytest.approx(14.0 if dynamics["shape"] == "step" else 10.0)
    for time_s, wanted in speeds.items():
        assert drive.to(time_s)["lead"].speed_mps == pytest.approx(wanted, abs=1e-6)


def test_braking_takes_the_way_of_its_rate() -> None:
    brake = speed(0.0, shape="linear", by="rate", value=5.0)
    drive = Drive(story_of([one_event("lead", brake, start=after(0.0))]), {"lead": car(50.0, reach=POINT)})
    assert drive.to(6.0)["lead"].x_m == pytest.approx(50.0 + 10.0**2 / (2 * 5.0), abs=1e-6)
    assert drive.engine.states["story::act"] == "complete"


def test_speed_by_distance_follows_the_way() -> None:
    drive = Drive(
        story_of([one_event("lead", speed(20.0, shape="linear", by="distance", value=30.0), start=after(0.0))]),
        {"lead": car(0.0, reach=POINT)},
    )
    drive.to(6.0)
    begins = next(p["lead"] for p in drive.history if p["lead"].x_m > 14.5)
    assert begins.speed_mps == pytest.approx(10.0 + 10.0 * begins.x_m / 30.0, abs=0.3)
    assert drive.engine.played["lead"].speed_mps == 20.0


@pytest.mark.parametrize(("how", "value", "wanted"), [("delta", -3.0, 9.0), ("factor", 0.5, 6.0)])
def test_speed_relative_to_the_ego(how: str, value: float, wanted: float) -> None:
    target = {"to": "ego", "value": value, "how": how}
    drive = Drive(story_of([one_event("lead", speed(target))]), {"lead": car(50.0)}, ego_mps=12.0)
    assert drive.to(0.1)["lead"].speed_mps == pytest.approx(wanted)


@pytest.mark.parametrize(("continuous", "wanted"), [(True, 13.0), (False, 11.0)])
def test_continuous_speed_follows_the_other(continuous: bool, wanted: float) -> None:
    target = {"to": "ego", "value": 1.0, "continuous": continuous}
    drive = Drive(story_of([one_event("lead", speed(target))]), {"lead": car(50.0)})
    drive.to(1.0)
    drive.ego_mps = 12.0
    assert drive.to(2.0)["lead"].speed_mps == pytest.approx(wanted)


def test_speed_profile_is_linear_between_its_entries() -> None:
    entries = [{"speed": 14.0, "time_s": 2.0}, {"speed": 14.0, "time_s": 1.0}, {"speed": 4.0}]
    profile = {"kind": "speed_profile", "entries": entries, "brake_mps2": 5.0}
    drive = Drive(story_of([one_event("lead", profile)]), {"lead": car(50.0)})
    for time_s, wanted in {1.0: 12.0, 2.5: 14.0, 4.0: 9.0, 5.0: 4.0, 6.0: 4.0}.items():
        assert drive.to(time_s)["lead"].speed_mps == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("fields", "wanted_m"),
    [
        ({"distance_m": 20.0}, 20.0),  # of the reference points
        ({"distance_m": 20.0, "freespace": True}, 20.0 + 3.0 + 1.0),  # the ego's front, the car's rear
        ({"time_gap_s": 2.0, "freespace": True}, 2.0 * 10.0 + 4.0),
        ({"distance_m": 20.0, "displacement": "behind"}, -20.0),
        ({"distance_m": 20.0, "displacement": "behind", "freespace": True}, -(20.0 + 1.0 + 3.0)),
    ],
)
def test_unbounded_distance_is_there_at_once(fields: dict[str, Any], wanted_m: float) -> None:
    do = {"kind": "longitudinal_distance", "to": "ego", "displacement": "ahead", **fields}
    init = [{"actor": "lead", "do": do}]
    drive = Drive(story_of(init=init), {"lead": car(233.0)}, ego=Pose(200.0, 0.0, 0.0))
    assert drive.history[0]["lead"].x_m - CAR.ahead_m == pytest.approx(200.0 + wanted_m)


def test_bounded_distance_closes_in_and_keeps_its_bounds() -> None:
    do = {"kind": "longitudinal_distance", "to": "ego", "distance_m": 30.0, "accel_mps2": 2.0, "brake_mps2": 3.0}
    drive = Drive(story_of([one_event("lead", do)]), {"lead": car(60.0, reach=POINT)})
    drive.to(30.0)
    accels = [moment["lead"].accel_mps2 for moment in drive.history[1:]]
    assert drive.engine.played["lead"].x_m - 300.0 == pytest.approx(30.0, abs=0.2)
    assert max(accels) <= 2.0 + 1e-6
    assert min(accels) >= -3.0 - 1e-6


def test_continuous_distance_holds_it() -> None:
    do = {"kind": "longitudinal_distance", "to": "ego", "distance_m": 25.0, "continuous": True}
    drive = Drive(story_of([one_event("lead", do)]), {"lead": car(60.0, reach=POINT)})
    for time_s in (1.0, 2.0, 5.0):
        assert drive.to(time_s)["lead"].x_m == pytest.approx(10.0 * time_s + 25.0, abs=1e-6)


def synchronised(final: dict[str, Any] | None, start_mps: float, at_m: float = 0.0, *, free: bool = False) -> Drive:
    do = {
        "kind": "synchronise",
        "master": "ego",
        "master_target": {"kind": "world", "x_m": 100.0, "y_m": 0.0, "heading_rad": 0.0},
        "target": {"kind": "world", "x_m": 60.0, "y_m": 3.5, "heading_rad": 0.0},
        "final_speed": final,
    }
    story = story_of([one_event("other", do)])
    return Drive(story, {"other": car(at_m, 1, start_mps, reach=POINT, free=free)})


def test_synchronised_actor_arrives_with_the_master() -> None:
    drive = synchronised({"speed": 8.0}, 4.0)
    time_s = 5.0  # s(t) = 4 t + a t² / 2 + j t³ / 6 with s(10) = 60 and s'(10) = 8
    first, jerk = 6 * 60 / 100 - (4 * 4 + 2 * 8) / 10, (6 * (4 + 8) * 10 - 12 * 60) / 1000
    halfway = 4 * time_s + first * time_s**2 / 2 + jerk * time_s**3 / 6
    assert drive.to(time_s)["other"].x_m == pytest.approx(halfway, abs=0.05)
    at_end = drive.to(10.0)["other"]
    assert (at_end.x_m, at_end.speed_mps) == pytest.approx((60.0, 8.0), abs=0.1)
    assert drive.to(12.0)["other"].speed_mps == pytest.approx(8.0, abs=0.05)


def test_synchronised_actor_without_final_speed_accelerates_evenly() -> None:
    drive = synchronised(None, 4.0)
    assert drive.to(5.0)["other"].speed_mps == pytest.approx(4.0 + 0.4 * 5.0, abs=1e-6)  # a = 2 (60 - 40) / 100
    assert drive.to(10.0)["other"].x_m == pytest.approx(60.0, abs=0.01)


def test_steady_state_is_driven_at_the_final_speed() -> None:
    drive = synchronised({"speed": 8.0, "steady_m": 16.0}, 0.0)
    drive.to(10.0)
    steady = [moment["other"] for moment in drive.history if 44.1 <= moment["other"].x_m <= 59.9]
    assert all(moment.speed_mps == pytest.approx(8.0, abs=0.1) for moment in steady)
    assert drive.engine.played["other"].x_m == pytest.approx(60.0, abs=0.2)


def test_walker_that_cannot_be_there_in_time_comes_late() -> None:
    drive = synchronised({"speed": 1.4}, 0.0, at_m=59.9, free=True)  # the course of 3 · 0.1 / 1.4 s is too steep
    drive.to(12.0)
    steepest = max(abs(moment["other"].accel_mps2) for moment in drive.history)
    assert steepest == pytest.approx(3.0)
    assert drive.engine.played["other"].speed_mps > 0.0


def test_standing_actor_waits_until_it_need_not_go_back() -> None:
    drive = synchronised({"speed": 8.0}, 0.0, at_m=52.0)  # 8 m in 10 s: the cubic course of 3 · 8 / 8 s begins at 7 s
    assert drive.to(6.9)["other"].x_m == pytest.approx(52.0)
    at_end = drive.to(10.0)["other"]
    assert (at_end.x_m, at_end.speed_mps) == pytest.approx((60.0, 8.0), abs=0.15)
