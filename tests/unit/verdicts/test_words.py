from collections.abc import Mapping

import pytest

from risk_sac.records import EgoPart, ReferenceOutcome
from risk_sac.verdicts.words import began, ego_did, known, prevented_by
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


def test_the_rule_for_cut_ins_is_told_apart_from_the_drivers() -> None:
    by_rule = "by R157's time-to-collision rule it is preventable"
    assert contact(NONE | {"r157_ttc": True}) == f"none of the reference drivers would have prevented it; {by_rule}"
    braking = {"full_braking": True, "r157_ttc": True}
    assert contact(NONE | braking) == f"only full braking at once would have prevented it; {by_rule}"
    assert contact(NONE | {"r157_ttc": False}) == "none of the reference drivers would have prevented it"


def test_nothing_is_said_where_no_driver_was_asked() -> None:
    assert contact({}) is prevented_by(violation(drivers={})) is prevented_by(collision(judgement=None)) is None


@pytest.mark.parametrize(
    ("hidden", "visible_for_s", "told", "when"),
    [
        (False, 3.0, "of which it had known for 3.0 s", "began 1.1 s before the contact"),
        (
            True,
            1.2,
            "of which it came to know only 1.2 s before",
            "began in hiding and came into sight 1.1 s before the contact",
        ),
        (True, 0.0, "of which it did not know when the conflict began, nor then", "was hidden until the contact"),
        (False, 0.0, "of which it did not know then, but when the conflict began", "began 1.1 s before the contact"),
    ],
)
def test_what_the_ego_knew_is_said_once(hidden: bool, visible_for_s: float, told: str, when: str) -> None:
    judged = judgement(hidden=hidden, conflict_s=2.4)
    hit = collision(time_s=3.5, visible_for_s=visible_for_s, judgement=judged)
    assert (known(hit), began(hit, judged)) == (told, f"the conflict {when}")


PART = EgoPart(
    seen_s=2.3,
    braked_after_s=1.1,
    braking_mps2=4.0,
    possible_mps2=7.6,
    gained_mps=0.2,
    started=False,
    sight_mps=None,
    sighted_mps=None,
    left_first="striker",
)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({}, "braked 1.1 s after the conflict began, by 4.0 of 7.6 m/s²"),
        ({"braked_after_s": 0.0}, "was braking when the conflict began, by 4.0 of 7.6 m/s²"),
        (
            {"braked_after_s": None, "started": True, "gained_mps": 1.4},
            "did not brake in the conflict; it drove on and gained 1.4 m/s though it saw the striker",
        ),
        (
            {"sight_mps": 5.8, "sighted_mps": 13.6},
            "braked 1.1 s after the conflict began, by 4.0 of 7.6 m/s²; it drove at 13.6 m/s where its sight allowed "
            "5.8 m/s",
        ),
        (
            {"braked_after_s": None, "sight_mps": 13.0, "sighted_mps": 13.6, "left_first": "ego"},
            "did not brake in the conflict; it was the first to leave RSS's proper response",
        ),
    ],
)
def test_what_the_ego_did_about_the_striker(changes: Mapping[str, object], told: str) -> None:
    assert ego_did(PART.model_copy(update=changes)) == told
