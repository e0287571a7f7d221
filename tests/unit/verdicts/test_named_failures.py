"""Recorded contacts by name, judged as an ADS engineer judges them; see `tests.unit.verdicts.recorded`."""

from dataclasses import replace
from typing import NamedTuple

import pytest

from risk_sac.records import Fault, Grade, Judgement, Severity
from risk_sac.verdicts.judge import judge
from tests.unit.verdicts.recorded import recorded
from tests.unit.verdicts.staged import mirrored


class Expected(NamedTuple):
    """What an engineer says of a contact."""

    fault: Fault
    grade: Grade
    response: str
    severity: Severity


NAMED = {
    # It passes a pedestrian on red that stands 0.5 m beside its way and speeds up, then brakes for 0.4 s.
    "dense_267": Expected(Fault.EGO, Grade.PREVENTABLE, "braking", Severity.MODERATE),
    # It stops in its turn, sees the crossing car for 7.7 s, and starts into it.
    "dense_263": Expected(Fault.EGO, Grade.PREVENTABLE, "starting", Severity.MODERATE),
    # It passes a vehicle that stops at an unsignalled crossing, at 14 m/s; a pedestrian comes from behind that vehicle.
    "mixed_71": Expected(Fault.EGO, Grade.PREVENTABLE, "braking", Severity.MODERATE),
    # Two vehicles side by side creep at 2 m/s, and their flanks touch.
    "mixed_294": Expected(Fault.OTHER, Grade.FULL_BRAKING, "braking", Severity.MINOR),
    # A vehicle that overtakes comes over from alongside, twice; the ego rolls on, or brakes late.
    "low_267": Expected(Fault.SHARED, Grade.PREVENTABLE, "none", Severity.MODERATE),
    "low_198": Expected(Fault.SHARED, Grade.PREVENTABLE, "late_braking", Severity.MODERATE),
}


def verdict(name: str) -> Judgement:
    evidence, striker = recorded(name)
    return judge(evidence, striker, valid=True)


@pytest.mark.parametrize("name", NAMED)
def test_what_an_engineer_says(name: str) -> None:
    found, expected = verdict(name), NAMED[name]
    assert (found.fault, found.grade, found.ego_response, found.severity) == expected


@pytest.mark.parametrize("name", NAMED)
def test_the_mirrored_contact_has_the_same_verdict(name: str) -> None:
    evidence, striker = recorded(name)
    evidence = replace(evidence, ground=replace(evidence.ground, net=""))  # there is no mirrored net
    first, second = (judge(each, striker, valid=True) for each in (evidence, mirrored(evidence)))
    assert second.ego_part == first.ego_part
    for name in ("fault", "grade", "ego_response", "severity"):
        assert getattr(second, name) == getattr(first, name)


def test_an_ego_that_sped_up_or_started_is_said_to_have() -> None:
    past_pedestrian, into_car = (verdict(name).ego_part for name in ("dense_267", "dense_263"))
    assert past_pedestrian is not None
    assert (past_pedestrian.seen_s, past_pedestrian.gained_mps) == (4.6, pytest.approx(2.0, abs=0.1))
    assert into_car is not None
    assert (into_car.seen_s, into_car.started) == (7.7, True)


def test_a_speed_that_did_not_fit_its_sight_is_stated() -> None:
    part = verdict("mixed_71").ego_part
    assert part is not None
    assert part.sighted_mps == pytest.approx(13.4, abs=0.1)
    assert part.sight_mps == pytest.approx(7.6, abs=0.1)
