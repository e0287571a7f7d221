from typing import Any

import pytest

from risk_sac.verdicts.distinct import FailureKind, kind_of
from tests.builders import collision, judgement


def kind(judged: dict[str, Any] | None = None, **changes: Any) -> FailureKind:
    return kind_of(collision(**changes), judgement(**(judged or {})))


@pytest.mark.parametrize(
    ("changes", "field", "value"),
    [
        ({"visible_for_s": 0.59}, "visible", 0),
        ({"visible_for_s": 0.6}, "visible", 1),
        ({"visible_for_s": 2.0}, "visible", 2),
        ({"ego_peak_braking_mps2": 2.9}, "ego_braked", False),
        ({"ego_peak_braking_mps2": 3.0}, "ego_braked", True),
        ({"relative_speed_mps": 4.9}, "closing_speed", 0),
        ({"relative_speed_mps": 5.0}, "closing_speed", 1),
        ({"relative_speed_mps": 10.0}, "closing_speed", 2),
        ({"ego_zone": "left"}, "ego_zone", "left"),
        ({"ego_zone": "left", "other_kind": "pedestrian"}, "ego_zone", ""),
        ({"other_role": "background"}, "striker", "background vehicle"),
    ],
)
def test_a_kind_is_told_by_its_edges(changes: dict[str, Any], field: str, value: object) -> None:
    assert getattr(kind(**changes), field) == value


def test_what_no_axis_speaks_of_makes_no_kind() -> None:
    assert kind() == kind(time_s=7.0, contact_y_m=0.3, judged={"conflict_s": 1.1, "signature": "another"})
    assert kind() != kind(judged={"ego_manoeuvre": "left_turn"})
