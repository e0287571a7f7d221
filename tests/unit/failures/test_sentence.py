import math
from typing import Any

import numpy as np
import pytest

from risk_sac.failures.sentence import sentence, story
from tests.builders import collision, judgement, violation

RELEASE = 5  # frames before it
ROWS = 41


def series(*, kind: int = 0, x_m: float = 4.0, y_m: float = 3.2, heading: float = 0.0, **of_striker: Any) -> Any:
    """Ego at 14 m/s eastward and a striker beside it, for 4 s with the release after the first half second."""
    zero = np.zeros(ROWS)
    columns = {
        "x_m": (14.0 * np.arange(ROWS) / 10, 14.0 * np.arange(ROWS) / 10 + x_m),
        "y_m": (zero, zero + y_m),
        "heading_rad": (zero, zero + heading),
        "speed_mps": (zero + 14.0, zero + of_striker.get("speed_mps", 14.0)),
        "accel_mps2": (of_striker.get("ego_accel_mps2", zero), of_striker.get("accel_mps2", zero)),
        "lateral_mps": (zero, of_striker.get("lateral_mps", zero)),
    }
    return {
        **{name: np.column_stack(pair) for name, pair in columns.items()},
        "time_s": np.arange(ROWS) / 10,
        "released_s": np.array(RELEASE / 10),
        "ids": np.array(["ego", "lead"]),
        "kind": np.array([0, kind], np.int8),
    }


def during(first_s: float, last_s: float, value: float) -> np.ndarray:
    """A value between two times since the release, and else nothing."""
    time_s = (np.arange(ROWS) - RELEASE) / 10
    return np.where((time_s > first_s - 0.05) & (time_s < last_s - 0.05), value, 0.0)


def said(response: str = "none", broke: tuple[str, ...] = (), ego_broke: tuple[str, ...] = (), **changes: Any) -> str:
    judged = judgement(conflict_s=1.0, broke=broke, ego_broke=ego_broke, ego_response=response)
    return sentence(series(**changes), collision(time_s=3.5, judgement=judged))


def test_a_neighbour_that_moves_over_while_the_ego_brakes_late() -> None:
    late = said("late_braking", lateral_mps=during(1.0, 2.5, -1.1), ego_accel_mps2=during(2.65, 3.5, -3.0))
    assert late == "left neighbour, 4 m ahead, moves right at 1.1 m/s for 1.5 s; ego at 14 m/s brakes 0.6 s late"


def test_in_the_mirror_the_sides_are_exchanged() -> None:
    mirrored = said(y_m=-3.2, lateral_mps=during(1.0, 2.5, 1.1))
    assert mirrored == "right neighbour, 4 m ahead, moves left at 1.1 m/s for 1.5 s; ego at 14 m/s does not brake"


@pytest.mark.parametrize(
    ("who", "where"),
    [
        ("leader, 12 m ahead", {"x_m": 12.0, "y_m": 0.3}),
        ("oncoming vehicle, 30 m ahead", {"x_m": 30.0, "heading": math.pi}),
        ("vehicle from the right, 15 m ahead", {"x_m": 15.0, "y_m": -9.0, "heading": math.pi / 2}),
        ("vehicle from the left, 15 m ahead", {"x_m": 15.0, "y_m": 9.0, "heading": -math.pi / 2}),
        ("vehicle from the right, 15 m ahead", {"x_m": 15.0, "y_m": 2.0, "heading": math.pi / 2}),  # past the middle
        ("pedestrian on the right, 9 m ahead", {"x_m": 9.0, "y_m": -3.2, "kind": 1, "heading": math.pi / 2}),
        ("pedestrian on the left, 9 m ahead", {"x_m": 9.0, "kind": 1, "heading": -math.pi / 2}),
        ("left neighbour, 2 m behind", {"x_m": -2.0}),
        ("left neighbour, level with it", {"x_m": 0.2}),
    ],
)
def test_who_strikes_is_told_from_where_it_is(who: str, where: dict[str, Any]) -> None:
    assert said(**where).startswith(f"{who}, goes on at 14 m/s; ")


def test_a_violation_without_contact_tells_what_the_nearest_actor_did_until_then() -> None:
    braking = series(x_m=20.0, y_m=0.0, accel_mps2=during(0.5, 3.0, -4.0))
    told = story(braking, violation(time_s=1.5, other_id="lead", ego_speed_mps=14.0, broke=("speeding",)))
    assert told == "leader, 20 m ahead, brakes at 4.0 m/s² for 1.1 s; ego at 14 m/s speeding violates never_fast"
    assert story(braking, violation(time_s=0.0)) == "no other road user near; ego at 9 m/s violates never_fast"
