from collections.abc import Mapping

import pytest

from risk_sac.records import ReferenceOutcome
from risk_sac.verdicts.words import prevented_by
from tests.builders import collision, judgement, violation

NONE = {"r157": False, "fsm": False, "rss": False, "full_braking": False}


def contact(drivers: Mapping[str, bool]) -> str | None:
    outcomes = {name: ReferenceOutcome(avoids=avoids, impact_speed_mps=0.0) for name, avoids in drivers.items()}
    return prevented_by(collision(judgement=judgement(drivers=outcomes)))


@pytest.mark.parametrize(
    ("who", "preventing"),
    [
        ("none of the reference drivers", []),
        ("only full braking at once", ["full_braking"]),
        ("R157's driver", ["r157"]),
        ("the RSS driver and full braking at once", ["rss", "full_braking"]),
        ("R157's driver, the fuzzy safety model and full braking at once", ["r157", "fsm", "full_braking"]),
        ("full braking at once and the far sighted driver", ["full_braking", "far_sighted"]),
    ],
)
def test_all_drivers_that_would_have_prevented_it_are_named(who: str, preventing: list[str]) -> None:
    drivers = NONE | dict.fromkeys(preventing, True)
    assert contact(drivers) == prevented_by(violation(drivers=drivers)) == f"{who} would have prevented it"


def test_nothing_is_said_where_no_driver_was_asked() -> None:
    assert contact({}) is prevented_by(violation(drivers={})) is prevented_by(collision(judgement=None)) is None
