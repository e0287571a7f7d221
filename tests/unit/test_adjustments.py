"""What is used otherwise than it was asked for is said."""

import pytest

from risk_sac.adjustments import adjustments
from risk_sac.config import CampaignSpec, Requirement
from risk_sac.problem import checked_campaign


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


def test_visibility_beyond_the_sensor_is_said_to_change_nothing() -> None:
    [clipped, beyond] = said(("low",), environment={"visibility_m": {"low": 20, "high": 100}})
    assert "asked for [20, 100], used [40, 100] in low; the family supports [40, 2000]" in clipped
    assert "asked for [40, 100], used [40, 80] in low; the ego's sensor sees 80 m: nothing changes from" in beyond
    [all_beyond] = said(("low",), environment={"visibility_m": {"low": 150, "high": 500}})
    assert all_beyond.endswith("nothing changes")


def test_a_sensor_beyond_the_default_visibility_is_said_to_be_shortened() -> None:
    [shortened] = said(("low", "mixed"), ego={"sensor": {"range_m": 150}})
    assert shortened.startswith("ego.sensor.range_m: asked for 150, used 100 in low, mixed; ")
    assert (
        said(("low",), ego={"sensor": {"range_m": 150}}, environment={"visibility_m": {"low": 90, "high": 150}}) == []
    )


def test_a_shipped_requirement_that_a_family_lacks_is_said_and_counts_where_there_is_one() -> None:
    spec = CampaignSpec(families=("low", "mixed"), requirements=(Requirement(name="pedestrian_gap"),))
    checked_campaign(spec)
    (adjustment,) = adjustments(spec)
    assert (adjustment.families, adjustment.field, adjustment.used) == (("low",), "requirements[0]", "nothing")
    assert "pedestrian_gap" in adjustment.why
