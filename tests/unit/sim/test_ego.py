import math
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.sim.ego import Belief, Glimpse, Perception
from risk_sac.types import Frame
from tests.unit.sim.contacts import CAR, WALKER, ego, frames

WALKING = (20.0, -3.0, math.pi / 2, 0.0, 1.4, WALKER)
PARKED = (30.0, 3.0, 0.0, 0.0, 0.0, CAR)


def frame_at(time_s: float) -> Frame:
    """The walker has walked since 0 s."""
    _, frame = frames(ego(), WALKING, PARKED, share=1.0)
    y = frame.y_m + 1.4 * time_s * np.array([0, 1, 0])
    return replace(frame, time_s=time_s, ids=("ego", "walker", "parked"), y_m=y)


def look(perception: Perception, time_s: float, *seen: str) -> Belief:
    return perception.update(frame_at(time_s), np.array(["walker" in seen, "parked" in seen]))


def test_a_glimpse_moves_on_by_hand() -> None:
    seen = Glimpse(time_s=2.0, x_m=20.0, y_m=-3.0, heading_rad=1.5, vx_mps=-0.5, vy_mps=1.4)
    assert seen.moved_on(2.0) == seen
    later = Glimpse(time_s=4.5, x_m=18.75, y_m=0.5, heading_rad=1.5, vx_mps=-0.5, vy_mps=1.4)
    assert seen.moved_on(4.5) == pytest.approx(later)


def test_who_was_never_seen_is_hidden() -> None:
    assert look(Perception(3.0), 1.0, "parked") == Belief(frozenset({"walker"}), {})


def test_who_goes_out_of_sight_is_expected_to_go_on_until_memory_ends() -> None:
    perception = Perception(memory_s=2.0)
    assert look(perception, 1.0, "walker", "parked") == Belief(frozenset(), {})
    hidden, expected = look(perception, 2.0, "parked")
    assert hidden == frozenset()
    assert expected == {"walker": pytest.approx((2.0, 20.0, -3.0 + 1.4 * 2.0, math.pi / 2, 0.0, 1.4))}
    hidden, expected = look(perception, 3.0, "parked")
    assert expected["walker"].y_m == pytest.approx(-3.0 + 1.4 * 3.0)
    assert look(perception, 3.1, "parked") == Belief(frozenset({"walker"}), {})


def test_what_is_expected_is_what_was_seen_last_and_not_what_is() -> None:
    perception = Perception(memory_s=2.0)
    look(perception, 1.0, "walker", "parked")
    frame = frame_at(1.5)
    stopped = replace(frame, y_m=frame_at(1.0).y_m, vy_mps=np.zeros(3))
    expected = perception.update(stopped, np.array([False, True])).expected
    assert expected["walker"].y_m == pytest.approx(-3.0 + 1.4 * 1.5)


def test_without_memory_who_is_out_of_sight_is_hidden_at_once() -> None:
    perception = Perception(memory_s=0.0)
    look(perception, 1.0, "walker", "parked")
    assert look(perception, 1.1, "parked") == Belief(frozenset({"walker"}), {})


def test_a_flicker_is_no_break_and_more_is() -> None:
    perception = Perception(memory_s=3.0)
    for tenth in range(10, 16):
        look(perception, tenth / 10, "walker")
    for tenth in range(16, 20):
        look(perception, tenth / 10)
    look(perception, 2.0, "walker")
    assert perception.in_view_for("walker", 2.0) == pytest.approx(1.0)
    for tenth in range(21, 27):
        look(perception, tenth / 10)
    assert perception.in_view_for("walker", 2.6) == 0.0
    look(perception, 2.7, "walker")
    assert perception.in_view_for("walker", 2.9) == pytest.approx(0.2)
    assert perception.ever_seen("walker")
    assert not perception.ever_seen("parked")


def test_a_new_episode_begins_with_nobody_known() -> None:
    perception = Perception(memory_s=3.0)
    look(perception, 1.0, "walker", "parked")
    perception.reset()
    assert not perception.ever_seen("walker")
    assert look(perception, 1.0) == Belief(frozenset({"walker", "parked"}), {})
