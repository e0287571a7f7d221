"""What is used otherwise than it was asked for is said."""

import pytest

from risk_sac.adjustments import adjustments
from risk_sac.config import CampaignSpec


def said(families: tuple[str, ...] = ("low", "mixed", "dense"), ego: object = None, **odd: object) -> list[str]:
    return [str(each) for each in adjustments(CampaignSpec(families=families, odd=odd, ego=ego or {}))]


def test_nothing_is_said_of_an_odd_that_is_used_as_it_is() -> None:
    assert said() == []
    assert said(environment={"friction": {"low": 0.6, "high": 0.7}}) == []
    assert said(("mixed",), environment={"time_of_day": ["day", "night"], "precipitation": ["rain"]}) == []


@pytest.mark.parametrize(
    ("families", "odd", "words"),
    [
        (
            ("mixed",),
            {"environment": {"friction": {"low": 0.2, "high": 0.9}}},
            "odd.environment.friction: asked for [0.2, 0.9], used [0.4, 0.9] in mixed; the family supports [0.4, 1]",
        ),
        (
            ("low", "mixed"),
            {"environment": {"time_of_day": ["day", "night"]}},
            "odd.environment.time_of_day: asked for {day, night}, used {day} in low; the family supports {day}",
        ),
        (
            ("mixed", "low", "dense"),
            {"scenery": {"speed_limit_mps": {"low": 5, "high": 30}}},
            "odd.scenery.speed_limit_mps: asked for [5, 30], used [13.89, 13.89] in mixed, dense; "
            "the family supports [13.89, 13.89]",
        ),
        (
            ("mixed",),
            {"scenery": {"signal_types": ["none"], "crossing_types": ["zebra", "signalised"]}},
            "odd.scenery.crossing_types: asked for {signalised, zebra}, used {zebra} in mixed; other fields bound it",
        ),
        (
            ("mixed",),
            {"dynamic": {"pedestrian_speed_mps": {"low": 0, "high": 3}}},
            "odd.dynamic.pedestrian_speed_mps: asked for [0, 3], used [0, 2] in mixed; "
            "scenes begin with pedestrian_speed_mps in [0, 2]",
        ),
    ],
)
def test_what_is_clipped_is_said(families: tuple[str, ...], odd: dict[str, object], words: str) -> None:
    assert words in said(families, **odd)
