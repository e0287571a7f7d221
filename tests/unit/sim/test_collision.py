"""The oracle on hand-made frames; `tests/integration/test_oracle.py` holds it against SUMO's own list."""

import math

import pytest

from tests.builders import moved
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
    Actor,
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
def test_the_contact_lies_where_the_bodies_met(
    actors: tuple[Actor, ...], ego_zone: str, other_zone: str, x_m: float, y_m: float
) -> None:
    contact = contact_of(*frames(*actors))
    assert contact is not None
    assert (contact.ego_zone, contact.other_zone) == (ego_zone, other_zone)
    assert (contact.x_m, contact.y_m) == pytest.approx((x_m, y_m), abs=0.03)


def test_relative_motion_at_the_contact() -> None:
    contact = contact_of(*frames(*CROSSING))
    assert contact is not None
    assert contact.relative_speed_mps == pytest.approx(math.hypot(8, 12))
    assert contact.closing_lateral_other_mps == pytest.approx(12.0)
    assert contact.closing_lateral_ego_mps == pytest.approx(0.0)
    assert contact.heading_sin == pytest.approx(1.0)
    assert contact.lateral_offset_m == pytest.approx(-(WIDTH_M + LENGTH_M) / 2, abs=0.02)


@pytest.mark.parametrize("actors", [INTO_LEADER, CUT_IN, SIDESWIPE, CROSSING, INTO_WALKER])
@pytest.mark.parametrize("step_s", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_time_and_place_do_not_depend_on_the_step(actors: tuple[Actor, ...], step_s: float, share: float) -> None:
    fine = contact_of(*frames(*actors, step_s=0.001))
    contact = contact_of(*frames(*actors, step_s=step_s, share=share))
    assert fine is not None
    assert contact is not None
    assert contact.time_s == pytest.approx(5.0, abs=0.001)
    assert (contact.x_m, contact.y_m) == pytest.approx((fine.x_m, fine.y_m), abs=0.03)
    assert (contact.ego_zone, contact.other_zone) == (fine.ego_zone, fine.other_zone)


def test_of_two_contacts_in_a_step_the_earlier_one_is_reported() -> None:
    late = (LENGTH_M + 0.2, -1.0, 0.0, 0.0, 0.0, CAR)  # reached 20 ms after the other
    early = (LENGTH_M / 2 + 0.25, 0.7, 0.0, 0.0, 0.0, WALKER)
    contact = contact_of(*frames(ego(10.0), late, early))
    assert contact is not None
    assert contact.other == 2
    assert contact.time_s == pytest.approx(5.0, abs=0.001)


def test_bodies_apart_make_no_contact() -> None:
    assert contact_of(*frames(ego(10.0), (LENGTH_M + 5, 0.0, 0.0, 0.0, 0.0, CAR))) is None


def test_a_near_miss_is_no_contact() -> None:
    assert contact_of(*frames(ego(15.0), (0.0, WIDTH_M + 0.01, 0.0, 5.0, 0.0, CAR))) is None


def test_the_first_frame_of_an_episode_has_no_step_to_look_back_on() -> None:
    _, frame = frames(*INTO_LEADER)
    contact = contact_of(None, frame)
    assert contact is not None
    assert contact.time_s == frame.time_s


def test_a_contact_is_found_when_another_actor_has_just_left() -> None:
    before, _ = frames(*INTO_LEADER, (500.0, 0.0, 0.0, 10.0, 0.0, CAR))
    _, frame = frames(*INTO_LEADER)
    contact = contact_of(before, frame)
    assert contact is not None
    assert contact.other == 1


def test_headings_that_pass_south_are_interpolated_the_short_way() -> None:
    before, frame = frames(ego(10.0), (LENGTH_M, 0.0, math.pi, -10.0, 0.0, CAR))
    before = moved(before, heading_rad=[0.0, -math.pi + 0.01])
    contact = contact_of(before, frame)
    assert contact is not None
    assert contact.time_s == pytest.approx(5.0, abs=0.005)
    assert contact.ego_zone == "front"
