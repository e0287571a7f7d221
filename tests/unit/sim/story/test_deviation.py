"""Bounded deviations from a story."""

import math
from functools import partial

import pytest

from risk_sac.scenario.bodies import BODIES
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.layout import Deviation
from risk_sac.scenario.limits import Limits, limits_from_odd
from risk_sac.sim.story.cast import DeviationControl, Lead
from tests.unit.sim.story.straight import Drive, car, one_event, story_of

BOUNDS = Deviation(1.5, 0.5)


def limits() -> Limits:
    return limits_from_odd(FAMILIES["low"].odd, 1.0).of(BODIES["car"])


def lead(drive: float, steer: float, bounds: Deviation = BOUNDS) -> Lead:
    return partial(DeviationControl(bounds, limits(), free=False).step, drive, steer)


def plain(lane: int = 1) -> Drive:
    return Drive(story_of(), {"car": car(50.0, lane, 10.0)})


def test_zero_action_is_the_story_exactly() -> None:
    brake = {"kind": "speed", "target": 4.0, "dynamics": {"shape": "sinusoidal", "by": "time", "value": 3.0}}
    change = {
        "kind": "lane_change",
        "target": {"to": "ego", "lanes": 0},
        "dynamics": {"shape": "cubic", "by": "time", "value": 4.0},
    }
    drives = [Drive(story_of([one_event("car", brake, change)]), {"car": car(50.0, 1)}) for _ in range(2)]
    drives[0].to(6.0)
    drives[1].to(6.0, {"car": lead(0.0, 0.0)})
    assert drives[0].history == drives[1].history
    assert not drives[1].engine.deviated


def test_full_drive_adds_its_acceleration() -> None:
    drive = plain()
    at = drive.to(2.0, {"car": lead(1.0, 0.0)})["car"]
    assert at.accel_mps2 == pytest.approx(1.5)
    assert 2.5 < at.speed_mps - 10.0 <= 3.0  # less while the acceleration builds up
    assert drive.engine.deviated == {"car"}


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_full_steer_adds_its_lateral_speed(side: float) -> None:
    at = plain().to(2.0, {"car": lead(0.0, side)})["car"]
    assert at.lateral_mps == pytest.approx(side * 0.5)
    assert side * at.left_m == pytest.approx(0.9, abs=0.1)
    assert at.speed_mps == 10.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_deviation_fades_but_the_way_stays(side: float) -> None:
    drive, control = plain(), DeviationControl(BOUNDS, limits(), free=False)
    drive.to(2.0, {"car": partial(control.step, 1.0, side)})
    drive.to(10.0, {"car": partial(control.step, 0.0, 0.0)})
    at = drive.engine.played["car"]
    assert (at.speed_mps, at.left_m) == pytest.approx((10.0, 0.0), abs=0.01)
    assert at.x_m > 50.0 + 1.0 + 100.0 + 3.0


def test_sum_keeps_the_limits() -> None:
    own = limits()
    brake = {"kind": "speed", "target": 0.0, "dynamics": {"shape": "linear", "by": "rate", "value": own.brake_mps2}}
    drive = Drive(story_of([one_event("car", brake)]), {"car": car(50.0, 1, 20.0)})
    drive.to(4.0, {"car": lead(-1.0, 0.0)})
    accels = [moment["car"].accel_mps2 for moment in drive.history[1:]]
    assert min(accels) == pytest.approx(-own.brake_mps2)


def test_actor_stays_on_the_road() -> None:
    drive = Drive(story_of(), {"car": car(50.0, 2)})
    at = drive.to(20.0, {"car": lead(0.0, 1.0)})["car"]
    assert at.left_m <= 1.75 - 1.0 + 1e-6


def test_standing_actor_does_not_move_across() -> None:
    drive = Drive(story_of(), {"car": car(50.0, 1, 0.0)})
    assert drive.to(2.0, {"car": lead(0.0, 1.0)})["car"].left_m == 0.0


def test_actor_never_drives_backwards() -> None:
    drive = plain()
    drive.to(20.0, {"car": lead(-1.0, 0.0, Deviation(5.0, 0.0))})
    assert drive.engine.played["car"].speed_mps == pytest.approx(0.0)
    assert all(math.isfinite(moment["car"].x_m) and moment["car"].speed_mps >= 0.0 for moment in drive.history)
