"""Triggers of a story that fire later or earlier."""

import pytest

from tests.unit.sim.story.straight import Drive, after, car, one_event, story_of

CHANGE = {"kind": "speed", "target": 4.0, "dynamics": {"shape": "step", "by": "time", "value": 0.0}}
NEAR = {
    "kind": "distance",
    "of": ["ego"],
    "to": "car",
    "along": "longitudinal",
    "rule": "less",
    "value": 30.0,
    "edge": "rising",
}


def begins_s(start, shift_s, *, ego_mps=20.0, do=CHANGE, after_s=6.0):
    """Time when a car's event begins, by its speed; None if never."""
    shifts = {"car": shift_s}
    drive = Drive(story_of([one_event("car", do, start=start)]), {"car": car(60.0)}, ego_mps=ego_mps, shifts_s=shifts)
    drive.to(after_s)
    slowed = [step for step, played in enumerate(drive.history) if played["car"].speed_mps < 9.0]
    return (round(slowed[0] * 0.1, 6) if slowed else None), drive.engine


@pytest.mark.parametrize("start", [after(3.0), after(3.0, edge="rising"), [[NEAR]]])
@pytest.mark.parametrize("shift_s", [-1.0, -0.5, 0.5, 1.0])
def test_trigger_fires_as_much_later_as_it_is_shifted(start, shift_s):
    as_written, _ = begins_s(start, 0.0)
    shifted, engine = begins_s(start, shift_s)
    assert shifted - as_written == pytest.approx(shift_s, abs=0.1001)
    assert engine.furthest["car"].trigger_s == abs(shift_s)
    assert engine.deviated == {"car"}


@pytest.mark.parametrize("shift_s", [0.0, 0.04, -0.04])
def test_shift_below_half_a_step_is_the_story(shift_s):
    _, engine = begins_s(after(3.0), shift_s)
    assert engine.deviated == frozenset()
    assert engine.furthest == {}


def test_edge_that_is_too_near_to_be_seen_ahead_fires_as_written():
    begun, _ = begins_s(after(0.5, edge="rising"), -1.0)
    assert begun == pytest.approx(0.5)  # ahead it holds from the start on


def test_delay_of_a_trigger_that_holds_once_only_is_counted_from_there():
    once = [[{"kind": "time", "rule": "equal", "value": 2.0}]]
    assert begins_s(once, 1.0)[0] == pytest.approx(3.0)


def test_event_that_begins_with_its_act_is_not_shifted():
    assert begins_s(None, 1.0)[0] == begins_s(None, 0.0)[0]
