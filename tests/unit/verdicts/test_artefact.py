import math
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.records import ARTEFACT_RULES, REPEATS
from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.validity import EpisodeFacts, artefact_verdicts, inside_grip, used_grip
from risk_sac.world.types import Kind
from tests.unit.verdicts.staged import CLEAN, cut_in, hangs_over, leader_brakes, mirrored, sideways, stage, straight

CAR = Kind.VEHICLE
CARS = (CAR, CAR, CAR)


def broken(evidence: Evidence, facts: EpisodeFacts = CLEAN) -> set[str]:
    found = artefact_verdicts(evidence, 1, find_conflict(evidence, 1), facts)
    assert set(found) == ARTEFACT_RULES - {REPEATS}
    return {rule for rule, passed in found.items() if not passed}


def test_a_clean_contact_passes():
    assert broken(cut_in()) == set()


def beside(x_m: float, until_s: float) -> Evidence:
    """Ego runs into its leader; beside, one car drives through another `until_s`."""
    first, second = straight(x_m, 3.3, 0.0, 14.0), straight(x_m + 3.0, 3.3, 0.0, 14.0)
    parts = sideways(second, until_s, 40.0, 4.0)  # out of the way within a step
    kinds = (*CARS, CAR)
    return stage(straight(0.0, 0.0, 0.0, 14.0), straight(24.6, 0.0, 0.0, 14.0, (2.0, -8.0)), first, parts, kinds=kinds)


@pytest.mark.parametrize(
    ("x_m", "until_s", "rules"),
    [
        (-30.0, -2.0, set()),
        (-30.0, -0.5, {"no_spawn_overlap"}),
        (30.0, 0.05, {"no_spawn_overlap"}),
        (-30.0, 1.0, {"no_spawn_overlap", "solid_bodies"}),
    ],
)
def test_two_others_that_overlap_refuse_the_contact_wherever_they_are(x_m, until_s, rules):
    record = beside(x_m, until_s)
    assert broken(record) == rules
    assert broken(mirrored(record)) == rules


def test_a_striker_that_came_through_another_body_is_refused():
    through = stage(*(straight(x, 0.0, 0.0, v) for x, v in ((0.0, 14.0), (40.0, 6.0), (42.0, 14.0))), kinds=CARS)
    assert broken(through) >= {"no_spawn_overlap"}
    walker = straight(30.0, 5.6, -math.pi / 2, 2.0, start_s=0.0)
    parked = straight(30.0, 3.3, 0.0, 0.0)
    run_into = stage(straight(-28.0, 0.0, 0.0, 14.0), walker, parked, kinds=(CAR, Kind.PEDESTRIAN, CAR))
    assert "solid_bodies" in broken(run_into)


def test_a_striker_that_the_road_cannot_hold_breaks_inside_grip():
    braking = leader_brakes(braking=8.0)
    assert broken(replace(braking, ground=replace(braking.ground, friction=0.6))) == {"inside_grip"}


@pytest.mark.parametrize(("at_s", "rules"), [(0.5, {"conflict_after_release"}), (0.7, set()), (2.0, set())])
def test_a_conflict_of_the_first_second_was_inherited(at_s, rules):
    assert broken(cut_in(gap=8.0, at_s=at_s)) == rules  # 0.3125 s later it is 0.375 m over


@pytest.mark.parametrize(("at_s", "rules"), [(0.5, {"conflict_after_release"}), (0.8, set())])
def test_who_hung_over_in_the_first_second_was_inherited_whenever_it_comes(at_s, rules):
    assert broken(hangs_over(at_s=at_s, comes_at_s=2.5)) == rules


def on(friction: float, evidence: Evidence) -> bool:
    slippery = replace(evidence, ground=replace(evidence.ground, friction=friction))
    found, again = inside_grip(slippery, 1), inside_grip(mirrored(slippery), 1)
    assert found == again
    return found


def driving(path: object, until_s: float = 4.0) -> Evidence:
    """Striker with this motion; ego and contact do not matter."""
    evidence = stage(straight(0.0, 0.0, 0.0, 0.0), straight(3.0, 0.0, 0.0, 0.0))
    times = np.arange(0, until_s, 0.1)
    poses = np.array([path(t) for t in times])
    columns = {
        name: np.stack((np.zeros(len(times)), poses[:, i]), axis=1)
        for i, name in enumerate(("x_m", "y_m", "heading_rad"))
    }
    return replace(evidence, time_s=times, **columns)


def circle(speed: float, radius: float, jitter_s: float = 0.0) -> object:
    def at(t: float) -> tuple[float, float, float]:
        a = speed * t / radius
        seen = round(a / 0.2) * 0.2 if jitter_s else a  # headings of a polyline with kinks of 11 degrees
        return radius * math.sin(a), radius * (1 - math.cos(a)), seen

    return at


def test_cornering_takes_v_squared_over_r():
    # The front, half a length ahead of the centre, goes round on a circle of √(20² + 2.3²) m.
    used = used_grip(driving(circle(10.0, 20.0)), 1)
    assert used.max() == pytest.approx(5.0 * math.hypot(20.0, 2.3) / 20.0, rel=0.03)


@pytest.mark.parametrize(("speed", "friction", "inside"), [(10.0, 1.0, True), (10.0, 0.45, False), (14.5, 1.0, False)])
def test_a_turn_faster_than_the_road_bears_is_outside(speed, friction, inside):
    assert on(friction, driving(circle(speed, 20.0))) is inside


def test_cornering_and_braking_share_the_circle():
    def brakes_in_a_turn(t):
        gone = 16.0 * t - 2.5 * t * t  # 5 m/s², at 8 to 16 m/s
        a = gone / 40.0
        return 40.0 * math.sin(a), 40.0 * (1 - math.cos(a)), a

    evidence = driving(brakes_in_a_turn, until_s=1.6)
    assert 6.0 < used_grip(evidence, 1).max() < 8.5  # 5 and 3 to 6 across
    assert on(1.0, evidence)
    assert not on(0.55, evidence)


def test_kinks_of_a_lane_are_no_cornering():
    assert on(0.9, driving(circle(10.0, 20.0, jitter_s=0.1)))
