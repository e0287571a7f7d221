"""The oracle on hand-made frames; `tests/integration/test_oracle.py` holds it against SUMO's own list."""

import math

import numpy as np
import pytest
import shapely
from shapely import box
from shapely.affinity import rotate, translate

from risk_sac.sim.collision import find_contact
from risk_sac.world.geometry import relative_view
from risk_sac.world.types import HEADING, STEP_S, Frame, X, Y
from tests.builders import frame_of, moved
from tests.unit.sim.contacts import (
    CAR,
    CROSSING,
    CUT_IN,
    FROM_BEHIND,
    HEAD_ON,
    INTO_CROSSING,
    INTO_LEADER,
    INTO_WALKER,
    LENGTH_M,
    SIDESWIPE,
    WALKER,
    WIDTH_M,
    contact_of,
    ego,
    frames,
)


@pytest.mark.parametrize(
    ("actors", "ego_zone", "other_zone", "x_m", "y_m"),
    [
        (INTO_LEADER, "front", "rear", 2.3, 0.0),
        (FROM_BEHIND, "rear", "front", -2.3, 0.0),
        (SIDESWIPE, "left", "right", -0.25, 0.925),  # the sides share the stretch from -2.3 to 1.8
        (HEAD_ON, "front", "front", 2.3, 0.15),
        (CROSSING, "right", "front", 0.0, -0.925),
        (INTO_CROSSING, "front", "left", 2.3, 0.0),
        (INTO_WALKER, "front", "left", 2.3, 0.2),
    ],
)
def test_the_contact_lies_where_the_bodies_met(actors, ego_zone, other_zone, x_m, y_m):
    contact = contact_of(*frames(*actors))
    assert (contact.ego_zone, contact.other_zone) == (ego_zone, other_zone)
    assert (contact.x_m, contact.y_m) == pytest.approx((x_m, y_m), abs=0.03)


def test_relative_motion_at_the_contact():
    contact = contact_of(*frames(*CROSSING))
    assert contact.relative_speed_mps == pytest.approx(math.hypot(8, 12))
    assert contact.closing_lateral_other_mps == pytest.approx(12.0)
    assert contact.closing_lateral_ego_mps == pytest.approx(0.0)
    assert contact.heading_sin == pytest.approx(1.0)
    assert contact.lateral_offset_m == pytest.approx(-(WIDTH_M + LENGTH_M) / 2, abs=0.02)


@pytest.mark.parametrize("actors", [INTO_LEADER, CUT_IN, SIDESWIPE, CROSSING, INTO_WALKER])
@pytest.mark.parametrize("step_s", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_time_and_place_do_not_depend_on_the_step(actors, step_s, share):
    fine = contact_of(*frames(*actors, step_s=0.001))
    contact = contact_of(*frames(*actors, step_s=step_s, share=share))
    assert contact.time_s == pytest.approx(5.0, abs=0.001)
    assert (contact.x_m, contact.y_m) == pytest.approx((fine.x_m, fine.y_m), abs=0.03)
    assert (contact.ego_zone, contact.other_zone) == (fine.ego_zone, fine.other_zone)


def test_of_two_contacts_in_a_step_the_earlier_one_is_reported():
    late = (LENGTH_M + 0.2, -1.0, 0.0, 0.0, 0.0, CAR)  # reached 20 ms after the other
    early = (LENGTH_M / 2 + 0.25, 0.7, 0.0, 0.0, 0.0, WALKER)
    contact = contact_of(*frames(ego(10.0), late, early))
    assert contact.other == 2
    assert contact.time_s == pytest.approx(5.0, abs=0.001)


def crossing(turned_rad: float = 0.0) -> tuple[Frame, Frame]:
    """Two cars at 14 m/s cross at right angles for 87 ms."""
    x, y = 3.2557315650303864, -1.9705839164298644
    before, frame = frames(ego(14.0), (x, y, -math.pi / 2, 0.0, -14.0, CAR), share=0.0, time_s=10.0)
    return before, moved(frame, heading_rad=frame.heading_rad + np.array([0.0, turned_rad]))


def at(before: Frame, frame: Frame, share: float) -> list[shapely.Polygon]:
    """The bodies between two frames."""
    state = before.state + share * (frame.state - before.state)
    poses = zip(*state[[X, Y, HEADING]], frame.length_m / 2, frame.width_m / 2, strict=True)
    return [translate(rotate(box(-a, -b, a, b), h, (0, 0), use_radians=True), x, y) for x, y, h, a, b in poses]


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("turned_rad", [0.0, 0.05, -0.05])
def test_bodies_that_part_within_the_step_have_touched(side, turned_rad):
    before, frame = (moved(f, y_m=side * f.y_m, heading_rad=side * f.heading_rad) for f in crossing(turned_rad))
    assert not relative_view(before).overlap[0]
    assert not relative_view(frame).overlap[0]
    contact = find_contact(before, frame)
    assert 10.0 < contact.time_s < 10.01
    assert contact.lateral_offset_m * side < 0


def test_sweeping_the_bodies_agrees_with_shapely_on_random_steps():
    """Cars, long vehicles and pedestrians; moves ≤ 3 m, turns ≤ 30°."""
    generator, shares = np.random.default_rng(5), np.linspace(0.0, 1.0, 101)
    found = parted = 0
    for _ in range(300):
        place, way = generator.uniform(-7, 7, (2, 2)), generator.uniform(-3, 3, (2, 2))
        heading, turn = generator.uniform(-4, 4, 2), generator.uniform(-0.5, 0.5, 2)
        length, width = generator.choice([(4.6, 1.85), (16.5, 2.55), (0.5, 0.5)], 2).T
        x, y = place
        before = frame_of(x_m=x, y_m=y, heading_rad=heading, length_m=length, width_m=width)
        frame = moved(before, x_m=x + way[0], y_m=y + way[1], heading_rad=heading + turn)._replace(time_s=STEP_S)
        apart = np.array([a.distance(b) for a, b in (at(before, frame, share) for share in shares)])
        contact = find_contact(before, frame)
        if contact is None:
            assert apart.min() > 0.0
            continue
        share = contact.time_s / STEP_S
        assert math.isclose(shapely.distance(*at(before, frame, share)), 0.0, abs_tol=2e-5)
        assert (apart[shares < share - 1e-9] > 0.0).all()
        found, parted = found + 1, parted + bool(apart[0] > 0.0 and apart[-1] > 0.0)
    assert found > 50
    assert parted > 3


def test_a_near_miss_is_no_contact():
    assert contact_of(*frames(ego(15.0), (0.0, WIDTH_M + 0.01, 0.0, 5.0, 0.0, CAR))) is None


def test_the_first_frame_of_an_episode_has_no_step_to_look_back_on():
    _, frame = frames(*INTO_LEADER)
    contact = contact_of(None, frame)
    assert contact.time_s == frame.time_s


def test_a_contact_is_found_when_another_actor_has_just_left():
    before, _ = frames(*INTO_LEADER, (500.0, 0.0, 0.0, 10.0, 0.0, CAR))
    _, frame = frames(*INTO_LEADER)
    contact = contact_of(before, frame)
    assert contact.other == 1


def test_headings_that_pass_south_are_interpolated_the_short_way():
    before, frame = frames(ego(10.0), (LENGTH_M, 0.0, math.pi, -10.0, 0.0, CAR))
    before = moved(before, heading_rad=[0.0, -math.pi + 0.01])
    contact = contact_of(before, frame)
    assert contact.time_s == pytest.approx(5.0, abs=0.005)
    assert contact.ego_zone == "front"
