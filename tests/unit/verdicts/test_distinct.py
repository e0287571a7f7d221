import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.records import Collision
from risk_sac.verdicts.distinct import DistinctFailures, FailureKind, distinct_failures, kind_of
from tests.builders import collision, judgement


def failure(
    signature: str | None = "leader", ego: float = 6.0, other: float = 2.0, after: float = 1.0, **changes: Any
) -> Collision:
    return collision(
        time_s=2.0 + after,
        ego_speed_mps=ego,
        other_speed_mps=other,
        relative_speed_mps=ego - other,
        judgement=None if signature is None else judgement(None, 2.0, signature=signature),
        **changes,
    )


any_failure = st.builds(
    failure, st.sampled_from(["leader", "cut-in", None]), st.floats(0, 30), st.floats(0, 30), st.floats(0, 8)
)


@pytest.mark.parametrize(
    ("second", "distinct"),
    [
        (failure(), False),
        (failure(ego=8.3), False),
        (failure(ego=8.4), True),  # 30 km/h
        (failure(ego=20.0, after=-0.1), True),
        (failure(other=9.0), True),
        (failure(after=1.9), False),
        (failure(after=2.1), True),
        (failure("cut-in"), True),
        (failure(None), True),
        (failure(ego_zone="left", other_id="adv_1", min_robustness=0.0), False),
    ],
)
def test_signature_first_and_then_the_cell(second: Collision, distinct: bool) -> None:
    assert distinct_failures([failure(), second]) == ((0, 1) if distinct else (0,))


@given(st.lists(any_failure, max_size=30), st.randoms(use_true_random=False))
def test_the_count_is_the_same_in_any_order_and_after_a_resume(hits: list[Collision], order: random.Random) -> None:
    found, again = DistinctFailures(), DistinctFailures()
    for hit in hits:
        found.add(hit)
    shuffled = list(hits)
    order.shuffle(shuffled)
    for hit in shuffled + hits[:3]:
        again.add(hit)
    assert found.count == again.count == len(distinct_failures(hits))


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
